#include "server/store/connection.h"

#include <sqlite3.h>

#include "absl/strings/str_cat.h"

namespace calib::store {
namespace {

constexpr int kBusyTimeoutMs = 5000;

}  // namespace

absl::Status ToStatus(const SQLite::Exception& error) {
  const std::string text = absl::StrCat("state file: ", error.what());
  switch (error.getErrorCode() & 0xFF) {
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(
          absl::StrCat(text, "; free some space on the disk and start again"));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(text);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(absl::StrCat(
          text,
          "; it is damaged: put a copy of calib.db back in its place, or move it away and "
          "start with an empty state"));
    case SQLITE_IOERR:
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
      return absl::ResourceExhaustedError(
          absl::StrCat(text, "; the folder must be writable and its disk not full"));
    case SQLITE_CONSTRAINT:
    case SQLITE_MISMATCH:
    case SQLITE_TOOBIG:
    case SQLITE_RANGE:
      return absl::InvalidArgumentError(text);
    default:
      return absl::InternalError(text);
  }
}

Connection::Connection(const std::string& path, bool writable)
    : database_(path,
                writable ? SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE : SQLite::OPEN_READONLY,
                kBusyTimeoutMs) {
  if (writable) {
    database_.exec("PRAGMA journal_mode=WAL");
    database_.exec("PRAGMA synchronous=FULL");
    database_.exec("PRAGMA foreign_keys=ON");
  }
}

SQLite::Statement& Connection::Prepare(std::string_view sql) {
  auto& statement = statements_[sql];
  if (statement == nullptr) {
    statement = std::make_unique<SQLite::Statement>(database_, std::string(sql));
  } else {
    statement->tryReset();  // an error of its last run has been told
    statement->clearBindings();
  }
  return *statement;
}

std::vector<double> ToDoubles(const SQLite::Column& column) {
  std::vector<double> values(static_cast<std::size_t>(column.getBytes()) / sizeof(double));
  if (!values.empty()) {
    std::memcpy(values.data(), column.getBlob(), values.size() * sizeof(double));
  }
  return values;
}

}  // namespace calib::store
