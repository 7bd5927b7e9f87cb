#pragma once
// Effects of the build together with those that a user declares in the campaign file.

#include <span>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

/// What is wrong with a declared effect, a sentence each; empty: it can run. Names of effects and parameters are letters,
/// digits and _, begin with a letter and are nobody else's.
std::vector<std::string> UserEffectProblems(const UserEffect& effect);

/// An effect by name: of the build, or one of the declared; or nullptr.
const EffectInfo* FindEffect(std::span<const UserEffect> declared, const std::string& name);

/// The same for parameters: FindParameter() of the catalogue, with the declared effects.
const ParameterInfo* FindParameter(std::span<const UserEffect> declared, const std::string& contact,
                                   std::span<const std::string> effects,
                                   const std::string& dotted_name);

/// Those of the build, then the declared.
std::vector<const EffectInfo*> AllEffects(std::span<const UserEffect> declared);

}  // namespace calib::dem
