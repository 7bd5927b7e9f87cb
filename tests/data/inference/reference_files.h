#pragma once
// Readers of the reference JSON and CSV files.

#include <Eigen/Dense>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace calib::inference {

/// reference/inference/<name>.
nlohmann::json ReadReference(const std::string& name);
/// Columns by name of data/<path> or, with reference = true, of reference/inference/<path>; a
/// header line that may begin with '#', separated by commas or white space.
struct Table {
  std::vector<std::string> names;
  Eigen::MatrixXd values;
  Eigen::VectorXd Column(const std::string& name) const;
};
Table ReadTable(const std::string& path, bool reference = false);

Eigen::VectorXd ToVector(const nlohmann::json& array);
Eigen::MatrixXd ToMatrix(const nlohmann::json& rows);

}  // namespace calib::inference
