#include "server/report/views/lenient_json.h"

#include <nlohmann/json.hpp>

namespace calib::report {

using nlohmann::json;

void Read(const json& document, const char* key, double& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_number()) value = found->get<double>();
}
void Read(const json& document, const char* key, std::optional<double>& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_number()) value = found->get<double>();
}
void Read(const json& document, const char* key, std::string& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_string()) value = found->get<std::string>();
}
void Read(const json& document, const char* key, bool& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_boolean()) value = found->get<bool>();
}
void Read(const json& document, const char* key, std::vector<std::string>& value) {
  const auto found = document.find(key);
  if (found == document.end() || !found->is_array()) return;
  for (const json& item : *found) {
    if (item.is_string()) value.push_back(item.get<std::string>());
  }
}
void Read(const json& document, const char* key, std::map<std::string, double>& value) {
  const auto found = document.find(key);
  if (found == document.end() || !found->is_object()) return;
  for (const auto& [name, item] : found->items()) {
    if (item.is_number()) value[name] = item.get<double>();
  }
}
void Read(const json& document, const char* key, std::map<std::string, std::string>& value) {
  const auto found = document.find(key);
  if (found == document.end() || !found->is_object()) return;
  for (const auto& [name, item] : found->items()) {
    if (item.is_string()) value[name] = item.get<std::string>();
  }
}
void Read(const json& document, const char* key,
          std::vector<std::pair<std::string, std::string>>& value) {
  const auto found = document.find(key);
  if (found == document.end() || !found->is_array()) return;
  for (const json& item : *found) {
    if (!item.is_object()) continue;
    auto& [effect, reason] = value.emplace_back();
    Read(item, "effect", effect);
    Read(item, "reason", reason);
  }
}

}  // namespace calib::report
