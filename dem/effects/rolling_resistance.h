#pragma once
// `rolling_resistance`: a bending moment against relative rolling, elastic up to a limit.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   dM = k_m dtheta,  dtheta = (w2 - w1) without its normal part, times dt;   |M| <= eta Fn l
///   hertz_mindlin: k_m = stiffness [N m/rad] or stiffness_ratio r1 r2 ks (current ks),
///                  l = (r1 + r2)/2
///   linear:        k_m = stiffness r1 r2 ks (stiffness_ratio is the same),
///                  l = min(r1, r2)
/// M is carried along with the contact like the shear force. Vanishes at stiffness 0 or friction 0.
/// [Cheng 2018, Table 1]
EffectEntry RollingResistance();

}  // namespace calib::dem
