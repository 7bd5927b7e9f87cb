#pragma once
// `initial_fabric`: an anisotropic fabric left by the way the specimen was made.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// Consolidation follows q/p = a, the `stress_anisotropy`,
///   sigma_a = p (1 + 2/3 a),   sigma_r = p (1 - a/3),
/// and ends at the stress asked for: contacts made under the larger stress remain. Positive: made
/// under axial load, as by pluviation or K0 compression; negative: in extension. Two-sided,
/// vanishes at 0. [Oda 1972; Yimsiri & Soga 2010, by preshearing]
EffectEntry InitialFabric();

}  // namespace calib::dem
