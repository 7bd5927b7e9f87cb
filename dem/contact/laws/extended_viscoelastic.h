#pragma once
// `extended_viscoelastic`: a dashpot with a free exponent.

#include "dem/model/contact_law.h"

namespace calib::dem {

/// Entry of `extended_viscoelastic`, in the words of contact/viscoelastic.h
///   F = k u^{3/2} + gamma u' u^alpha,   alpha = `damping_exponent` [-] >= 0.
/// [Hadjidoukas 2014, Table 1, M3, Eq. 3]
ContactEntry ExtendedViscoelastic();

}  // namespace calib::dem
