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

/// Values of parameters in SI units by undotted name. Immutable; thread-safe.
class ParameterSet {
 public:
  explicit ParameterSet(std::map<std::string, double> values) : values_(std::move(values)) {}

  /// Value in SI units. Precondition: the set has a value of that name.
  [[nodiscard]] double Get(const std::string& name) const {
    const auto it = values_.find(name);
    assert(it != values_.end());
    return it->second;
  }

  /// Value in SI units, or nothing where the set has none, as of parameters that are alternatives.
  [[nodiscard]] std::optional<double> Find(const std::string& name) const {
    const auto it = values_.find(name);
    return it == values_.end() ? std::nullopt : std::optional<double>(it->second);
  }

 private:
  std::map<std::string, double> values_;
};

/// The parameters of one law or effect: values of `given` whose names begin with `prefix` ("", or
/// "rolling_resistance."), named without it, and the defaults of what was not given.
ParameterSet ResolveParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                               const std::map<std::string, double>& given);

}  // namespace calib::dem
