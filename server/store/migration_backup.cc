#include "server/store/migration_backup.h"

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "server/store/connection.h"
#include "server/store/migrations.h"
#include "server/store/whole_copy.h"

namespace calib::store {
namespace {

int SchemaOf(SQLite::Database& database) {
  return database.execAndGet("PRAGMA user_version").getInt();
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
    status = CopyWhole(connection.database(), copy);
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
