#pragma once
// A complete copy of the state file while it is used, and the state file made of one again.

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace SQLite {
class Database;
}

namespace calib::store {

/// Copies what `from` sees (with an open transaction: its one picture) to the file `to`, which has
/// its name once all of it is there, was looked through by SQLite and is on the disk; mode 0600.
/// goes_on is asked now and then; false: CANCELLED. Errors: RESOURCE_EXHAUSTED (no room),
/// DATA_LOSS (what was copied is damaged), PERMISSION_DENIED (the folder cannot be written);
/// nothing is left at `to` then. Throws SQLite::Exception.
absl::Status CopyWhole(
    SQLite::Database& from, const std::string& to,
    const std::function<bool()>& goes_on = [] { return true; });

/// Empty: SQLite finds no fault in the whole file.
std::string FaultOf(SQLite::Database& database);

/// Makes a copy ready to be served in the place of the original, which may have gone on since:
/// numbers of attempts go on far above those that it may have given. Campaigns in it. Errors:
/// DATA_LOSS (damaged, or no state file), FAILED_PRECONDITION (written by a newer program).
absl::StatusOr<std::int64_t> MakeServable(const std::string& copy);

/// A file or a folder is on the disk, entries of a folder included; "": this folder.
absl::Status SyncFile(const std::string& path);

}  // namespace calib::store
