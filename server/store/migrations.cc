#include "server/store/migrations.h"

#include "absl/strings/str_cat.h"
#include "server/store/connection.h"

namespace calib::store {

absl::Status Migrate(Connection& connection) {
  try {
    SQLite::Database& database = connection.database();
    const int found = database.execAndGet("PRAGMA user_version").getInt();
    const int known = static_cast<int>(Migrations().size());
    if (found > known) {
      return absl::FailedPreconditionError(absl::StrCat("the state file has schema version ", found,
                                                        ", this program knows ", known,
                                                        ": use the newer program that wrote it"));
    }
    for (const Migration& migration : Migrations().subspan(static_cast<std::size_t>(found))) {
      SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
      database.exec(migration.sql);
      database.exec("PRAGMA user_version=" + std::to_string(migration.number));
      transaction.commit();
    }
    return absl::OkStatus();
  } catch (const SQLite::Exception& error) {
    return connection.StatusOf(error);
  }
}

}  // namespace calib::store
