#pragma once
// A copy of the state file as it was before its schema is changed, so that the program that wrote
// it can be used again. Private to this folder.

#include <string>

#include "absl/status/status.h"

namespace calib::store {

class Connection;

/// Makes `path`.before-N beside the file of an earlier schema, N being the schema of this program:
/// complete, looked through by SQLite, forced to the disk, mode 0600. One of the same content that
/// an interrupted migration has left is kept. A new file, and one that needs no migration, get
/// none. Errors: RESOURCE_EXHAUSTED (no room for the copy), DATA_LOSS (what was copied is damaged),
/// PERMISSION_DENIED (the folder cannot be written). Nothing has been changed then.
absl::Status BackUpBeforeMigration(Connection& connection, const std::string& path);

}  // namespace calib::store
