#pragma once
// Fields of JSON documents that another version may have written: what is missing, null or of
// another type stays as it was.

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace calib::report {

/// Each function reads the field `key` of an object into `value`, which stays as it is where the
/// field is missing, null or of another type.
void Read(const nlohmann::json& document, const char* key, double& value);
void Read(const nlohmann::json& document, const char* key, std::optional<double>& value);
void Read(const nlohmann::json& document, const char* key, std::string& value);
void Read(const nlohmann::json& document, const char* key, bool& value);
void Read(const nlohmann::json& document, const char* key, std::vector<std::string>& value);
void Read(const nlohmann::json& document, const char* key, std::map<std::string, double>& value);
void Read(const nlohmann::json& document, const char* key,
          std::map<std::string, std::string>& value);
/// Reads a list of objects with "effect" and "reason" as pairs.
void Read(const nlohmann::json& document, const char* key,
          std::vector<std::pair<std::string, std::string>>& value);

}  // namespace calib::report
