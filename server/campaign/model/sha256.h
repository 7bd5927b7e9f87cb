#pragma once
// Content is named by its SHA-256.

#include <string>

namespace calib::campaign {

/// 64 lower-case hexadecimal digits.
std::string Sha256Hex(const std::string& content);

}  // namespace calib::campaign
