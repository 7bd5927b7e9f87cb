#include "server/store/whole_copy.h"

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/SQLiteCpp.h>
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

/// Of the file, between two looks at whether to go on: some 4 MB.
constexpr int kPagesAtATime = 1024;
/// Between the numbers of attempts of a restored state and those of its original: more than a
/// server gives in its life, and a small share of those there are (proto: 9e15).
constexpr std::int64_t kAttemptsApart = 1'000'000'000;

absl::Status Because(const std::string& path, int error) {
  const std::string text = absl::StrCat(path, ": ", std::generic_category().message(error));
  return error == ENOSPC || error == EDQUOT
             ? absl::ResourceExhaustedError(absl::StrCat(text, "; its disk needs room"))
             : absl::PermissionDeniedError(text);
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
      return Because(path_, errno);
    }
    close(file);
    return absl::OkStatus();
  }
  /// Gives it its name once all of it is on the disk.
  absl::Status Keep(const std::string& name) {
    RETURN_IF_ERROR(SyncFile(path_));
    if (std::rename(path_.c_str(), name.c_str()) != 0) {
      return Because(path_, errno);
    }
    kept_ = true;
    return SyncFile(std::filesystem::path(name).parent_path().string());
  }

 private:
  const std::string path_;
  bool kept_ = false;
};

}  // namespace

absl::Status SyncFile(const std::string& path) {
  const int file = open(path.empty() ? "." : path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0 || fsync(file) != 0) {
    const int error = errno;
    if (file >= 0) {
      close(file);
    }
    return Because(path, error);
  }
  close(file);
  return absl::OkStatus();
}

std::string FaultOf(SQLite::Database& database) {
  const std::string found = database.execAndGet("PRAGMA integrity_check(1)").getString();
  return found == "ok" ? "" : found;
}

absl::Status CopyWhole(SQLite::Database& from, const std::string& to,
                       const std::function<bool()>& goes_on) {
  Draft draft(to + ".new");
  RETURN_IF_ERROR(draft.Make());
  {
    SQLite::Database copy(to + ".new", SQLite::OPEN_READWRITE);
    try {
      SQLite::Backup backup(copy, from);
      while (backup.executeStep(kPagesAtATime) != SQLITE_DONE) {
        if (!goes_on()) {
          return absl::CancelledError("the copy was not finished");
        }
      }
    } catch (const SQLite::Exception& error) {
      return ToStatus(error, sqlite3_system_errno(copy.getHandle()));
    }
    try {
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

absl::StatusOr<std::int64_t> MakeServable(const std::string& copy) {
  try {
    SQLite::Database database(copy, SQLite::OPEN_READWRITE);
    const int schema = database.execAndGet("PRAGMA user_version").getInt();
    const int known = static_cast<int>(Migrations().size());
    if (schema > known) {
      return absl::FailedPreconditionError(absl::StrCat("its schema is ", schema,
                                                        ", this program knows ", known,
                                                        ": use the newer program that made it"));
    }
    if (schema == 0) {
      return absl::DataLossError("it holds no campaigns of this program");
    }
    std::string fault = FaultOf(database);
    if (fault.empty() &&
        database.execAndGet("SELECT count(*) FROM pragma_foreign_key_check").getInt64() > 0) {
      fault = "rows that belong to none";
    }
    if (!fault.empty()) {
      return absl::DataLossError(absl::StrCat("SQLite finds in it: ", fault));
    }
    database.exec(absl::StrCat("UPDATE sqlite_sequence SET seq = seq + ", kAttemptsApart,
                               " WHERE name = 'attempt'"));
    return database.execAndGet("SELECT count(*) FROM campaign").getInt64();
  } catch (const SQLite::Exception& error) {
    return absl::DataLossError(absl::StrCat("SQLite says of it: ", error.what()));
  }
}

}  // namespace calib::store
