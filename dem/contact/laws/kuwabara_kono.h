#pragma once
// `kuwabara_kono`: viscoelastic spheres.

#include "dem/model/contact_law.h"

namespace calib::dem {

/// Entry of `kuwabara_kono`, in the words of contact/viscoelastic.h
///   F = k u^{3/2} + gamma u' u^{1/2}.
/// Restitution falls with the speed of impact as 1 - e ~ v^{1/5}.
/// [Kuwabara & Kono 1987; Brilliantov et al. 1996; Hadjidoukas 2014, Table 1, M2]
ContactEntry KuwabaraKono();

}  // namespace calib::dem
