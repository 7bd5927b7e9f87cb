#pragma once
// How a worker comes by content that a lease names, and gives away what stays with a run.

#include <functional>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"

namespace calib::worker {

/// Content by digest. Called on a thread of its own; should end soon after a stop is asked for.
using Fetch =
    std::function<absl::StatusOr<std::string>(const std::string& digest, std::stop_token)>;

/// Hands content over; the same of threads and stops. Errors: why it is not taken.
using Put = std::function<absl::Status(const std::string& content, std::stop_token)>;

}  // namespace calib::worker
