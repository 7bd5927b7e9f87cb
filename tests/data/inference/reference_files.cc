#include "tests/data/inference/reference_files.h"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace calib::inference {
namespace {

const std::string kData = CALIB_DATA_DIR;
const std::string kReference = kData + "/../reference/inference";

std::istringstream Fields(std::string line) {
  std::replace(line.begin(), line.end(), ',', ' ');
  line.erase(std::remove(line.begin(), line.end(), '#'), line.end());
  return std::istringstream(line);
}

}  // namespace

nlohmann::json ReadReference(const std::string& name) {
  std::ifstream file(kReference + "/" + name);
  if (!file) throw std::runtime_error("cannot read " + name);
  return nlohmann::json::parse(file);
}

Table ReadTable(const std::string& path, bool reference) {
  std::ifstream file((reference ? kReference : kData) + "/" + path);
  if (!file) throw std::runtime_error("cannot read " + path);
  Table table;
  std::string line;
  std::getline(file, line);
  auto header = Fields(line);
  for (std::string name; header >> name;) table.names.push_back(name);
  std::vector<double> flat;
  while (std::getline(file, line)) {
    auto fields = Fields(line);
    for (double value = 0; fields >> value;) flat.push_back(value);
  }
  const auto columns = static_cast<Eigen::Index>(table.names.size());
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  table.values =
      Eigen::Map<RowMajor>(flat.data(), static_cast<Eigen::Index>(flat.size()) / columns, columns);
  return table;
}

Eigen::VectorXd Table::Column(const std::string& name) const {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw std::runtime_error("no column " + name);
  return values.col(found - names.begin());
}

Eigen::VectorXd ToVector(const nlohmann::json& array) {
  const auto values = array.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Eigen::MatrixXd ToMatrix(const nlohmann::json& rows) {
  Eigen::MatrixXd matrix(rows.size(), rows.at(0).size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    matrix.row(static_cast<Eigen::Index>(i)) = ToVector(rows[i]);
  return matrix;
}

}  // namespace calib::inference
