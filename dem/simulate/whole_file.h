#pragma once
// Files that are there as a whole or not at all.

#include <string>

#include "absl/status/status.h"

namespace calib::dem {

/// Puts a file with this content in place of whatever has this name: written beside it, brought to
/// the disk, then renamed, so that who reads the name meets the old content or the new one, also
/// after a kill or a power cut; a kill may leave what was written so far as PATH.PID.part. Errors:
/// UNAVAILABLE with the name and the reason; the old file is then still there. Thread-safe for
/// different paths.
absl::Status WriteWholeFile(const std::string& path, const std::string& content);

}  // namespace calib::dem
