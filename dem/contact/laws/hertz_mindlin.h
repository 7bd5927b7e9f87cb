#pragma once
// `hertz_mindlin`: Hertz normal force, Mindlin's no-slip tangential stiffness, both from the
// current overlap.

#include "dem/model/contact_law.h"

namespace calib::dem {

/// Entry of `hertz_mindlin`: two elastic spheres with one Young's modulus E and Poisson's ratio nu,
/// u the overlap, r* = r1 r2/(r1 + r2):
///   Fn = kn u,     kn = 2E / (3(1 - nu^2)) sqrt(r* u)
///                  (Fn = 4/3 E* sqrt(r*) u^{3/2}, E* = E/(2(1 - nu^2)))
///   dFs = ks dus,  ks = 2E / ((1 + nu)(2 - nu)) sqrt(r* u)
/// dFn/du = 3/2 kn.
/// [Cheng 2018, Eqs. 5-6; Johnson 1985, sec. 4.2; Mindlin 1949]
ContactEntry HertzMindlin();

}  // namespace calib::dem
