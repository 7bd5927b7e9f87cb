#pragma once
// `twisting_resistance`: a moment about the normal against relative twisting, elastic up to a
// limit.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   dM = k_t dtheta,  dtheta = n.(w2 - w1) dt,   |M| <= eta Fn l
/// Stiffness k_t, limit and length l as in rolling_resistance, with parameters of their own (the
/// papers share one stiffness between rolling and twisting). Vanishes at stiffness 0 or friction 0.
/// [Cheng 2018, Table 1]
EffectEntry TwistingResistance();

}  // namespace calib::dem
