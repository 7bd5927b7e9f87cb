#pragma once
// Which workers and servers understand each other. Messages grow by fields that others may ignore;
// what must not be ignored is a feature, and what changes its meaning is a new protocol.

#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace calib {

/// Of this build. 1: nobody told it.
inline constexpr int kProtocol = 2;
/// That this build still speaks.
inline constexpr int kOldestProtocol = 1;

/// A worker's: ends a run of the DEM that comes to a limit of its campaign (`resources`).
inline constexpr char kLimitsRuns[] = "limits_runs";

/// FAILED_PRECONDITION where the other one's protocol (0: not told) is older than `oldest`.
/// other, own: "worker node3", "the server"; the older of the two is to be updated.
inline absl::Status CheckProtocol(const std::string& other, int protocol, const std::string& own,
                                  int oldest = kOldestProtocol) {
  const int told = protocol == 0 ? 1 : protocol;
  return told >= oldest ? absl::OkStatus()
                        : absl::FailedPreconditionError(
                              absl::StrCat(other, " speaks protocol ", told, ", ", own, " from ",
                                           oldest, " on: update ", other));
}

}  // namespace calib
