#pragma once
// `extended_viscoelastic`: a dashpot with a free exponent.

#include "dem/model/contact_law.h"

namespace calib::dem {

///   F = k u^{3/2} + gamma u' u^alpha: see viscoelastic.h.
/// alpha = `damping_exponent`. [Hadjidoukas 2014, Table 1, M3, Eq. 3]
ContactEntry ExtendedViscoelastic();

}  // namespace calib::dem
