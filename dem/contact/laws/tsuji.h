#pragma once
// `tsuji`: restitution that does not depend on the speed of impact.

#include "dem/model/contact_law.h"

namespace calib::dem {

/// Entry of `tsuji`, in the words of contact/viscoelastic.h
///   F = k u^{3/2} + gamma u' u^{1/4}.
/// Restitution e depends on gamma/sqrt(m* k) only:
///   gamma = -sqrt(5) ln e/sqrt(ln^2 e + pi^2) sqrt(m* k)
/// [Tsuji, Tanaka & Ishida 1992; Antypov & Elliott 2011, Eq. 17; Hadjidoukas 2014, Table 1, M1]
ContactEntry Tsuji();

}  // namespace calib::dem
