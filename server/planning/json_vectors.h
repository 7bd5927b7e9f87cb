#pragma once
// Vectors as JSON whose doubles come back bit for bit.

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <vector>

namespace calib::planning {

inline nlohmann::json VectorToJson(const Eigen::VectorXd& values) {
  return std::vector<double>(values.data(), values.data() + values.size());
}

/// Throws nlohmann::json::exception where it is no list of numbers.
inline Eigen::VectorXd VectorFromJson(const nlohmann::json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace calib::planning
