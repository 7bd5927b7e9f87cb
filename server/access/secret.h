#pragma once
// Secrets that two programs of one account share.

#include <string>

#include "absl/status/statusor.h"

namespace calib::access {

/// 64 hexadecimal digits that nobody can guess. INTERNAL: the system gives no random numbers.
absl::StatusOr<std::string> MakeToken();

/// Whether two texts are the same, in a time that depends on their lengths alone.
bool IsSameSecret(const std::string& a, const std::string& b);

}  // namespace calib::access
