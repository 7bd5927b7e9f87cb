#pragma once
// The list that CMake makes of the files in dem/effects (effect_list.cc.in).

#include <vector>

#include "dem/catalog/registry.h"

namespace calib::dem {

/// The entry of each file dem/effects/some_name.cc, made by its function SomeName(); in no order that
/// means anything.
std::vector<EffectEntry> FoundEffects();

}  // namespace calib::dem
