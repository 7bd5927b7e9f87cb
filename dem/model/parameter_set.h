#pragma once
// Parameters of one law or effect by their undotted names.

#include <cassert>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dem/model/parameter.h"

namespace calib::dem {

class ParameterSet {
 public:
  explicit ParameterSet(std::map<std::string, double> values) : values_(std::move(values)) {}

  /// Value in SI units. Precondition: validation has made sure that it is there.
  [[nodiscard]] double Get(const std::string& name) const {
    const auto it = values_.find(name);
    assert(it != values_.end());
    return it->second;
  }

  /// Value, or nothing: for parameters that are alternatives to each other.
  [[nodiscard]] std::optional<double> Find(const std::string& name) const {
    const auto it = values_.find(name);
    return it == values_.end() ? std::nullopt : std::optional<double>(it->second);
  }

 private:
  std::map<std::string, double> values_;
};

/// Given values of one law or effect without their prefix, and the defaults of what was not given.
ParameterSet ResolveParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                               const std::map<std::string, double>& given);

}  // namespace calib::dem
