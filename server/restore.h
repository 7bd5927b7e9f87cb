#pragma once
// A state folder from a backup.

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace calib {

/// Makes the state folder of what `calibctl backup` has written to `file`; the number of campaigns
/// in it. The folder is there as a whole or as it was before, however this process ends. Errors,
/// each one sentence: FAILED_PRECONDITION: the folder holds something, or the backup is of a newer
/// program; DATA_LOSS: the backup is damaged or none; NOT_FOUND: there is no such file;
/// RESOURCE_EXHAUSTED: no room; those of StateFolder::Open().
absl::StatusOr<std::int64_t> Restore(const std::string& file, const std::string& state_dir);

}  // namespace calib
