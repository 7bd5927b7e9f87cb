#include "dem/model/parameter.h"

#include <algorithm>

#include "dem/elementary/functions.h"
#include "dem/model/parameter_set.h"

namespace calib::dem {

const std::string& UnitFor(const ParameterInfo& parameter, const std::string& contact) {
  const auto it = parameter.unit_by_contact.find(contact);
  return it == parameter.unit_by_contact.end() ? parameter.unit : it->second;
}

double ScaleOf(const ParameterInfo& parameter, const std::string& contact,
               const ReferenceState& state) {
  const auto it = parameter.scale_by_contact.find(contact);
  const ReferenceScale& s = it == parameter.scale_by_contact.end() ? parameter.scale : it->second;
  return s.factor * Pow(state.pressure, s.pressure) * Pow(state.diameter, s.diameter) *
         Pow(state.modulus, s.modulus);
}

std::optional<double> NullValueOf(const ParameterInfo& parameter, const std::string& contact) {
  const auto it = parameter.null_by_contact.find(contact);
  return it == parameter.null_by_contact.end() ? parameter.null_value
                                               : std::optional<double>(it->second);
}

DefaultPrior PriorOf(const ParameterInfo& parameter, const std::string& contact,
                     const ReferenceState& state) {
  if (!parameter.scaled_prior) {
    return parameter.default_prior;
  }
  const double scale = ScaleOf(parameter, contact, state);
  return {.kind = parameter.scaled_prior->kind,
          .min = std::max(parameter.min, parameter.scaled_prior->min * scale),
          .max = std::min(parameter.max, parameter.scaled_prior->max * scale)};
}

ParameterSet ResolveParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                               const std::map<std::string, double>& given) {
  std::map<std::string, double> values;
  for (const ParameterInfo& info : infos) {
    if (const auto it = given.find(prefix + info.name); it != given.end()) {
      values[info.name] = it->second;
    } else if (info.default_value) {
      values[info.name] = *info.default_value;
    }
  }
  return ParameterSet(std::move(values));
}

}  // namespace calib::dem
