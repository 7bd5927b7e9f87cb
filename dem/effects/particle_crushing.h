#pragma once
// `particle_crushing`: grains that crush under their contact forces and lose size.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// Law and size-loss rule: dynamics/crushing.h. Vanishes at weakness 0 (infinite strength) and at
/// size_loss 0. One-sided. Fines carry no force and count as solid volume. [McDowell & Bolton 1998;
/// crushed material taken out of the skeleton as in Marketos & Bolton 2009]
EffectEntry ParticleCrushing();

}  // namespace calib::dem
