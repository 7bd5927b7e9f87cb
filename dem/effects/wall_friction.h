#pragma once
// `wall_friction`: grains slide on walls with another friction than on each other.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// |Fs| <= tan(phi_w) Fn at contacts with walls, tan(phi_w) = ratio tan(phi_mu), or given as such.
/// Null: ratio 1. [Samuelsson 2023, sec. 4.1: particle-particle and particle-steel friction]
EffectEntry WallFriction();

}  // namespace calib::dem
