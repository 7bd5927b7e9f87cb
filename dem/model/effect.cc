#include "dem/model/effect.h"

#include <algorithm>
#include <cassert>

namespace calib::dem {

namespace {

/// The ray's parameter and its value at a distance from the null.
double ValueOnRay(const ParameterInfo& parameter, double step, const std::string& contact,
                  const ReferenceState& state) {
  const auto null = NullValueOf(parameter, contact);
  assert(null);
  return step == 0 ? *null : *null + step * ScaleOf(parameter, contact, state);
}

const ParameterInfo& ParameterOf(const EffectInfo& effect, const std::string& name) {
  const auto it = std::find_if(effect.parameters.begin(), effect.parameters.end(),
                               [&](const ParameterInfo& info) { return info.name == name; });
  assert(it != effect.parameters.end());
  return *it;
}

}  // namespace

std::map<std::string, double> ParametersOnRay(const EffectInfo& effect, const StrengthRay& ray,
                                              double step, const std::string& contact,
                                              const ReferenceState& state) {
  const std::string prefix = effect.name + ".";
  std::map<std::string, double> values;
  values[prefix + ray.parameter] =
      ValueOnRay(ParameterOf(effect, ray.parameter), step, contact, state);
  for (const auto& [name, scaled] : ray.held) {
    values[prefix + name] = scaled * ScaleOf(ParameterOf(effect, name), contact, state);
  }
  return values;
}

bool RayAdmits(const EffectInfo& effect, const StrengthRay& ray, double step,
               const std::string& contact, const ReferenceState& state) {
  const ParameterInfo& parameter = ParameterOf(effect, ray.parameter);
  const double value = ValueOnRay(parameter, step, contact, state);
  return (parameter.min_open ? value > parameter.min : value >= parameter.min) &&
         value <= parameter.max;
}

bool Exclude(const EffectInfo& a, const EffectInfo& b) {
  const auto names = [](const EffectInfo& one, const EffectInfo& other) {
    return std::find(one.excludes.begin(), one.excludes.end(), other.name) != one.excludes.end();
  };
  return names(a, b) || names(b, a);
}

}  // namespace calib::dem
