#pragma once
// What calibctl tells the shell.

#include "absl/status/status.h"

namespace calib::ctl {

inline constexpr int kDone = 0;         ///< the answer was printed
inline constexpr int kFailed = 1;       ///< the campaign or the request failed
inline constexpr int kBadInput = 2;     ///< bad usage or bad input
inline constexpr int kUnreachable = 3;  ///< no server answered

/// Prints the message of a failed call to standard error and returns the exit code that belongs to
/// it.
int Fail(const absl::Status& status);

}  // namespace calib::ctl
