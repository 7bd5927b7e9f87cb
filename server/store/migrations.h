#pragma once
// The schema as numbered steps, compiled in from migrations/NNNN_what.sql (CMakeLists.txt of this
// folder lists them).

#include <span>

#include "absl/status/status.h"

namespace calib::store {

class Connection;

struct Migration {
  int number;  ///< user_version after it
  const char* name;
  const char* sql;
};

/// In order, numbered 1, 2, ...
std::span<const Migration> Migrations();

/// Brings the file to the last migration, one transaction each. FAILED_PRECONDITION: the file was
/// written by a newer program. Other errors as ToStatus(SQLite::Exception).
absl::Status Migrate(Connection& connection);

}  // namespace calib::store
