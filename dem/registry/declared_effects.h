#pragma once
// Effects of the build together with those that a user declares in the campaign file.

#include <span>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

/// What is wrong with an effect that a user declares, a sentence each; empty: it can run. Names of
/// effects and parameters are letters, digits and _, begin with a letter and are used once, by the
/// build too.
std::vector<std::string> UserEffectProblems(const UserEffect& effect);

/// The effect of this name, of the build or one of the declared, or nullptr.
const EffectInfo* FindEffect(std::span<const UserEffect> declared, const std::string& name);

/// The parameter of this dotted campaign name for a contact and a set of effects, some of which may
/// be declared, or nullptr when that model has no such parameter.
const ParameterInfo* FindParameter(std::span<const UserEffect> declared, const std::string& contact,
                                   std::span<const std::string> effects,
                                   const std::string& dotted_name);

/// All effects: those of the build in their order, then the declared. The pointers to declared ones
/// live as long as `declared`.
std::vector<const EffectInfo*> AllEffects(std::span<const UserEffect> declared);

}  // namespace calib::dem
