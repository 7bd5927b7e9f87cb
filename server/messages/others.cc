#include "server/messages/others.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace calib::messages {

std::string OthersToText(const google::protobuf::Map<std::string, double>& others) {
  nlohmann::json object = nlohmann::json::object();  // sorts its names
  for (const auto& [name, value] : others) {
    if (std::isfinite(value)) object[name] = value;
  }
  if (object.empty()) return "";
  return object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::map<std::string, double> OthersFromText(const std::string& text) {
  std::map<std::string, double> others;
  if (text.empty()) return others;
  const auto object = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!object.is_object()) return others;
  for (const auto& [name, value] : object.items()) {
    if (value.is_number()) others[name] = value.get<double>();
  }
  return others;
}

}  // namespace calib::messages
