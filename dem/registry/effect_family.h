#pragma once
// Which effects act alike, so that curves that show one of them may as well show another: what is
// sure of a family may be sure of none of its members.

#include <string>

#include "dem/model/effect.h"

namespace calib::dem {

/// The family of an effect of the catalogue, a word; empty: it has none, as effects that users
/// declare.
std::string FamilyOf(const EffectInfo& effect);

}  // namespace calib::dem
