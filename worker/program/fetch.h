#pragma once
// How a worker comes by content that a lease names.

#include <functional>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"

namespace calib::worker {

/// Content by digest. Called on a thread of its own; should end soon after a stop is asked for.
using Fetch =
    std::function<absl::StatusOr<std::string>(const std::string& digest, std::stop_token)>;

}  // namespace calib::worker
