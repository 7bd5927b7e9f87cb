#pragma once
// One SQLite connection with its prepared statements. Private to this folder: SQLiteCpp is seen by
// nobody else.

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace calib::store {

/// Doubles as a BLOB, bit for bit.
struct DoubleBlob {
  std::span<const double> values;
};

/// RESOURCE_EXHAUSTED for a disk that takes nothing (full, over its quota, read-only), which may
/// pass; UNAVAILABLE for a busy file, DATA_LOSS for a corrupt one, PERMISSION_DENIED for one that
/// cannot be opened, read or written, INVALID_ARGUMENT for rows that break a constraint, INTERNAL
/// otherwise. system_errno: what the system said to the call that failed (sqlite3_system_errno);
/// 0: not known.
absl::Status ToStatus(const SQLite::Exception& error, int system_errno = 0);

/// Not thread-safe: one thread at a time.
class Connection {
 public:
  /// Throws SQLite::Exception. Sets WAL, FULL synchronisation and foreign keys on a writable
  /// connection, whose files are this user's alone (mode 0600).
  Connection(const std::string& path, bool writable);
  /// The same, with what the system said where it fails (StatusOf).
  static absl::StatusOr<std::unique_ptr<Connection>> Open(const std::string& path, bool writable);

  SQLite::Database& database() { return database_; }
  /// What an error of this connection means, with what the system said to its last call.
  absl::Status StatusOf(const SQLite::Exception& error) const;

  /// The statement for `sql`, prepared once, reset and bound to the arguments in order. Throws
  /// SQLite::Exception.
  template <typename... Arguments>
  SQLite::Statement& Bind(std::string_view sql, const Arguments&... arguments) {
    SQLite::Statement& statement = Prepare(sql);
    int index = 0;
    (BindOne(statement, ++index, arguments), ...);
    return statement;
  }

  /// Runs a statement that gives no rows; returns the number of rows changed.
  template <typename... Arguments>
  int Run(std::string_view sql, const Arguments&... arguments) {
    SQLite::Statement& statement = Bind(sql, arguments...);
    const int changed = statement.exec();
    statement.reset();
    return changed;
  }

 private:
  struct Bare {};  // not set up yet
  Connection(const std::string& path, bool writable, Bare);
  void SetUp();
  SQLite::Statement& Prepare(std::string_view sql);

  template <typename T>
  static void BindOne(SQLite::Statement& statement, int index, const T& value) {
    statement.bind(index, value);
  }
  static void BindOne(SQLite::Statement& statement, int index, bool value) {
    statement.bind(index, value ? 1 : 0);
  }
  static void BindOne(SQLite::Statement& statement, int index, std::optional<std::int64_t> value) {
    if (value.has_value()) {
      statement.bind(index, *value);
    } else {
      statement.bind(index);
    }
  }
  static void BindOne(SQLite::Statement& statement, int index, DoubleBlob blob) {
    statement.bind(index, blob.values.data(), static_cast<int>(blob.values.size_bytes()));
  }

  SQLite::Database database_;
  const bool writable_;
  std::map<std::string, std::unique_ptr<SQLite::Statement>, std::less<>> statements_;  // by text
};

/// The doubles of a DoubleBlob, bit for bit.
std::vector<double> ToDoubles(const SQLite::Column& column);
void ToDoubles(const SQLite::Column& column, std::vector<double>& values);

}  // namespace calib::store
