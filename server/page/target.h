#pragma once
// What a request asks for, as text from a peer whom nobody trusts.

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::page {

/// The longest target that is read [bytes].
inline constexpr std::size_t kLongestTarget = 2048;

struct Target {
  std::vector<std::string> path{};             ///< decoded pieces between slashes; none: "/"
  std::map<std::string, std::string> query{};  ///< decoded; of a name given twice the first
};

/// The target of a request line. INVALID_ARGUMENT, a sentence: it does not begin with a slash, is
/// too long, holds a broken percent code, a control character (%00 among them) or a piece "." or
/// "..". Pure.
absl::StatusOr<Target> ParseTarget(std::string_view target);

/// The value of a cookie in a Cookie header; empty: it is not there.
std::string CookieIn(std::string_view header, std::string_view name);

/// The HOST of a Host header without its port, in lower case: "127.0.0.1", "[::1]", "localhost".
std::string HostIn(std::string_view header);

}  // namespace calib::page
