#pragma once
// Units of the strengths of effects.

#include <map>
#include <string>

#include "dem/registry/catalog.h"

namespace calib::diagnosis {

/// SI units of the parameters of an effect under a contact law, by dotted name.
std::map<std::string, std::string> UnitsOf(const dem::EffectInfo& effect,
                                           const std::string& contact);

}  // namespace calib::diagnosis
