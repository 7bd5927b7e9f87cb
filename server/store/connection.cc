#include "server/store/connection.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::store {
namespace {

constexpr int kBusyTimeoutMs = 5000;
constexpr mode_t kOwnersAlone = 0600;
/// The log beside the file is cut to this once all of it is in the file [bytes].
constexpr const char* kLargestLog = "PRAGMA journal_size_limit=67108864";
constexpr const char* kNeedsRoom = "; its disk needs room";

/// What a disk wants that takes nothing now, though the file is as it should be; empty: it is not
/// for that.
std::string WantedBy(int system_errno) {
  switch (system_errno) {
    case ENOSPC:
      return kNeedsRoom;
    case EDQUOT:
      return "; this account has used up its quota of the disk";
    case EROFS:
      return "; its file system has to be writable";
    default:
      return "";
  }
}

/// The path, once the files of its database are their owner's alone; SQLite gives those that it
/// makes beside it the same mode. Files of another owner stay as they are.
const std::string& Closed(const std::string& path) {
  if (const int made = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, kOwnersAlone);
      made >= 0) {
    close(made);
  }
  for (const char* suffix : {"", "-wal", "-shm"}) {
    chmod((path + suffix).c_str(), kOwnersAlone);
  }
  return path;
}

}  // namespace

absl::Status ToStatus(const SQLite::Exception& error, int system_errno) {
  const std::string text = absl::StrCat("state file: ", error.what());
  switch (error.getErrorCode() & 0xFF) {
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(absl::StrCat(text, kNeedsRoom));
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
      return !WantedBy(system_errno).empty()
                 ? absl::ResourceExhaustedError(
                       absl::StrCat(text, " (", std::generic_category().message(system_errno), ")",
                                    WantedBy(system_errno)))
                 : absl::PermissionDeniedError(
                       absl::StrCat(text, "; the folder must be writable and its disk sound"));
    case SQLITE_CONSTRAINT:
    case SQLITE_MISMATCH:
    case SQLITE_TOOBIG:
    case SQLITE_RANGE:
      return absl::InvalidArgumentError(text);
    default:
      return absl::InternalError(text);
  }
}

Connection::Connection(const std::string& path, bool writable, Bare /*not set up*/)
    : database_(writable ? Closed(path) : path,
                (writable ? SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE : SQLite::OPEN_READONLY) |
                    SQLite::OPEN_NOMUTEX,  // one thread at a time
                kBusyTimeoutMs),
      writable_(writable) {}

Connection::Connection(const std::string& path, bool writable)
    : Connection(path, writable, Bare{}) {
  SetUp();
}

absl::StatusOr<std::unique_ptr<Connection>> Connection::Open(const std::string& path,
                                                             bool writable) {
  try {
    std::unique_ptr<Connection> connection(new Connection(path, writable, Bare{}));
    try {
      connection->SetUp();
    } catch (const SQLite::Exception& error) {
      return connection->StatusOf(error);
    }
    return connection;
  } catch (const SQLite::Exception& error) {
    return ToStatus(error);
  }
}

void Connection::SetUp() {
  if (writable_) {
    database_.exec("PRAGMA auto_vacuum=INCREMENTAL");  // of a file that is made now
    database_.exec("PRAGMA journal_mode=WAL");
    database_.exec(kLargestLog);
    database_.exec("PRAGMA synchronous=FULL");
    database_.exec("PRAGMA foreign_keys=ON");
  }
}

absl::Status Connection::StatusOf(const SQLite::Exception& error) const {
  return ToStatus(error, sqlite3_system_errno(database_.getHandle()));
}

SQLite::Statement& Connection::Prepare(std::string_view sql) {
  const auto known = statements_.find(sql);
  if (known == statements_.end()) {
    const std::string text(sql);
    auto prepared = std::make_unique<SQLite::Statement>(database_, text);
    return *statements_.emplace(text, std::move(prepared)).first->second;
  }
  known->second->tryReset();  // an error of its last run has been told
  known->second->clearBindings();
  return *known->second;
}

void ToDoubles(const SQLite::Column& column, std::vector<double>& values) {
  values.resize(static_cast<std::size_t>(column.getBytes()) / sizeof(double));
  if (!values.empty()) {
    std::memcpy(values.data(), column.getBlob(), values.size() * sizeof(double));
  }
}

std::vector<double> ToDoubles(const SQLite::Column& column) {
  std::vector<double> values;
  ToDoubles(column, values);
  return values;
}

}  // namespace calib::store
