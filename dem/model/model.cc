#include "dem/model/model.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace calib::dem {

std::vector<std::string> MaterialNames(const Model& model) {
  std::vector<std::string> names = {kOwnMaterial};
  names.insert(names.end(), model.materials.begin(), model.materials.end());
  return names;
}

bool IsMaterialPair(const Model& model, const std::string& name) {
  const std::vector<std::string> names = MaterialNames(model);
  const auto has = [&names](const std::string& one) {
    return std::find(names.begin(), names.end(), one) != names.end();
  };
  const std::size_t dash = name.find('-');
  return dash != std::string::npos && has(name.substr(0, dash)) && has(name.substr(dash + 1)) &&
         name != absl::StrCat(kOwnMaterial, "-", kOwnMaterial);
}

}  // namespace calib::dem
