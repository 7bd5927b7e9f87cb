#include "dem/registry/declared_effects.h"

#include <algorithm>

#include "dem/formula/user_effect.h"
#include "dem/registry/catalog.h"

namespace calib::dem {

std::vector<std::string> UserEffectProblems(const UserEffect& effect) {
  return UserEffectProblems(effect, FindEffect(effect.info.name) != nullptr);
}

const EffectInfo* FindEffect(std::span<const UserEffect> declared, const std::string& name) {
  if (const EffectInfo* info = FindEffect(name)) return info;
  const auto it = std::find_if(declared.begin(), declared.end(),
                               [&](const UserEffect& e) { return e.info.name == name; });
  return it == declared.end() ? nullptr : &it->info;
}

const ParameterInfo* FindParameter(std::span<const UserEffect> declared, const std::string& contact,
                                   std::span<const std::string> effects,
                                   const std::string& dotted_name) {
  if (const ParameterInfo* info = FindParameter(contact, effects, dotted_name)) return info;
  const auto dot = dotted_name.find('.');
  const std::string prefix = dotted_name.substr(0, dot);
  const auto effect = std::find_if(declared.begin(), declared.end(),
                                   [&](const UserEffect& e) { return e.info.name == prefix; });
  if (dot == std::string::npos || effect == declared.end() ||
      std::find(effects.begin(), effects.end(), prefix) == effects.end()) {
    return nullptr;
  }
  const auto& parameters = effect->info.parameters;
  const auto it = std::find_if(
      parameters.begin(), parameters.end(),
      [name = dotted_name.substr(dot + 1)](const ParameterInfo& p) { return p.name == name; });
  return it == parameters.end() ? nullptr : &*it;
}

std::vector<const EffectInfo*> AllEffects(std::span<const UserEffect> declared) {
  std::vector<const EffectInfo*> all;
  for (const EffectInfo& info : Effects()) all.push_back(&info);
  for (const UserEffect& effect : declared) all.push_back(&effect.info);
  return all;
}

}  // namespace calib::dem
