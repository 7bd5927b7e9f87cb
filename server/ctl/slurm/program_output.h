#pragma once
// A program of the system, run to its end.

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::ctl {

/// What command[0], looked for on PATH, writes to standard output. NOT_FOUND: it is not installed.
/// INTERNAL: it failed, with the last line of what it wrote to standard error.
absl::StatusOr<std::string> OutputOf(const std::vector<std::string>& command);

}  // namespace calib::ctl
