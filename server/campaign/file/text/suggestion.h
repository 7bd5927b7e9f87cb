#pragma once
// Words for messages: lists of what is allowed, and the name a user probably meant.

#include <string>
#include <vector>

namespace calib::campaign {

/// "a, b, c"; "nothing" when empty.
std::string Listed(const std::vector<std::string>& names);

/// The candidate closest to `name` when it is close enough to be a slip of the pen; else empty.
std::string Nearest(const std::string& name, const std::vector<std::string>& candidates);

/// "did you mean 'x'?" when there is a near name, otherwise "allowed: a, b, c".
std::string Suggestion(const std::string& name, const std::vector<std::string>& candidates);

/// Length, number format and control characters made harmless for a one-line message: 'text', cut
/// at 60 characters.
std::string Quoted(const std::string& text);

}  // namespace calib::campaign
