#pragma once
// `linear`: springs whose stiffness grows with grain size, so that the packing's stiffness does not
// depend on it.

#include "dem/model/contact_law.h"

namespace calib::dem {

/// Entry of `linear`, u the overlap:
///   Fn = kn u,  kn = 2E r*,    dFs = ks dus,  ks = 2E nu r* = nu kn,    r* = r1 r2/(r1 + r2)
/// E is a contact modulus and the parameter named poisson_ratio is the ratio ks/kn.
/// [Cheng 2018, Eqs. 3-4]
ContactEntry Linear();

}  // namespace calib::dem
