#pragma once
// How the documents are written as text.

#include <nlohmann/json.hpp>
#include <string>

namespace calib::report {

/// Indented by two, with a newline at the end. NaN and infinities become null; texts from users may
/// be malformed UTF-8, which is replaced.
inline std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace calib::report
