#pragma once
// Text that came from users, made harmless inside HTML and SVG; and the page around a report.

#include <string>

namespace calib::report {

/// & < > " ' as entities; control characters other than tab and newline dropped; malformed UTF-8
/// replaced.
std::string Escape(const std::string& text);

/// A whole document with its style; title is escaped, body is not.
std::string Page(const std::string& title, const std::string& body);

}  // namespace calib::report
