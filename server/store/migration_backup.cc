#include "server/store/migration_backup.h"

#include <SQLiteCpp/Backup.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/store/connection.h"
#include "server/store/migrations.h"

namespace calib::store {
namespace {

int SchemaOf(SQLite::Database& database) {
  return database.execAndGet("PRAGMA user_version").getInt();
}

/// Empty: SQLite finds no fault in the whole file.
std::string FaultOf(SQLite::Database& database) {
  const std::string found = database.execAndGet("PRAGMA integrity_check(1)").getString();
  return found == "ok" ? "" : found;
}

/// Numbers that grow with whatever a server does, and that no migration changes.
std::string ProgressOf(SQLite::Database& database) {
  return database
      .execAndGet(
          "SELECT printf('%d %d %d %d', (SELECT max(id) FROM event), (SELECT max(rowid) FROM blob),"
          " (SELECT seq FROM sqlite_sequence WHERE name = 'campaign'),"
          " (SELECT seq FROM sqlite_sequence WHERE name = 'attempt'))")
      .getString();
}

/// Whether it is a sound copy of what the file held before the migration that is under way.
bool IsCopyOf(SQLite::Database& database, const std::string& copy) {
  std::error_code error;
  if (!std::filesystem::exists(copy, error)) {
    return false;
  }
  try {
    SQLite::Database before(copy, SQLite::OPEN_READONLY);
    return FaultOf(before).empty() && SchemaOf(before) > 0 &&
           SchemaOf(before) <= SchemaOf(database) && ProgressOf(before) == ProgressOf(database);
  } catch (const SQLite::Exception&) {
    return false;
  }
}

/// A file on its way to a complete one; goes with its object unless it was given its name.
class Draft {
 public:
  explicit Draft(std::string path) : path_(std::move(path)) {
    unlink(path_.c_str());  // left by a process that was killed
  }
  ~Draft() {
    if (!kept_) {
      unlink(path_.c_str());
    }
    unlink((path_ + "-journal").c_str());
  }
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;

  absl::Status Make() const {
    const int file = open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (file < 0) {
      return Because(errno);
    }
    close(file);
    return absl::OkStatus();
  }
  /// Gives it its name once all of it is on the disk.
  absl::Status Keep(const std::string& name) {
    RETURN_IF_ERROR(Sync(path_));
    if (std::rename(path_.c_str(), name.c_str()) != 0) {
      return Because(errno);
    }
    kept_ = true;
    return Sync(std::filesystem::path(name).parent_path().string());
  }

 private:
  absl::Status Because(int error) const {
    const std::string text = absl::StrCat(path_, ": ", std::generic_category().message(error));
    return error == ENOSPC || error == EDQUOT
               ? absl::ResourceExhaustedError(absl::StrCat(text, "; its disk needs room"))
               : absl::PermissionDeniedError(text);
  }
  /// Of a file or a folder; "": this one.
  absl::Status Sync(const std::string& path) const {
    const int file = open(path.empty() ? "." : path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0 || fsync(file) != 0) {
      const int error = errno;
      if (file >= 0) {
        close(file);
      }
      return Because(error);
    }
    close(file);
    return absl::OkStatus();
  }

  const std::string path_;
  bool kept_ = false;
};

absl::Status Copy(Connection& connection, const std::string& to) {
  Draft draft(to + ".new");
  RETURN_IF_ERROR(draft.Make());
  {
    SQLite::Database copy(to + ".new", SQLite::OPEN_READWRITE);
    try {
      SQLite::Backup(copy, connection.database()).executeStep(-1);
      copy.exec("PRAGMA journal_mode=DELETE");  // one file, with nothing beside it
      if (const std::string fault = FaultOf(copy); !fault.empty()) {
        return absl::DataLossError(absl::StrCat("SQLite finds in the copy: ", fault));
      }
    } catch (const SQLite::Exception& error) {
      return ToStatus(error, sqlite3_system_errno(copy.getHandle()));
    }
  }
  return draft.Keep(to);
}

}  // namespace

absl::Status BackUpBeforeMigration(Connection& connection, const std::string& path) {
  const int known = static_cast<int>(Migrations().size());
  const std::string copy = absl::StrCat(path, ".before-", known);
  int found = 0;
  absl::Status status;
  try {
    found = SchemaOf(connection.database());
    if (found == 0 || found >= known || IsCopyOf(connection.database(), copy)) {
      return absl::OkStatus();
    }
    status = Copy(connection, copy);
  } catch (const SQLite::Exception& error) {
    status = connection.StatusOf(error);
  }
  if (status.ok()) {
    return status;
  }
  std::error_code ignored;
  const auto bytes = std::filesystem::file_size(path, ignored);
  return {status.code(),
          absl::StrCat("its schema ", found, " is to become ", known, ", but no copy of it (about ",
                       ignored ? 0 : 1 + (bytes >> 20), " MiB) can be kept as ", copy, ": ",
                       status.message(), "; nothing has been changed")};
}

}  // namespace calib::store
