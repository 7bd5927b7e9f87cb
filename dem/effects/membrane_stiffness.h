#pragma once
// `membrane_stiffness`: a rubber membrane that confines a bulging specimen.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   sigma_r of the specimen = sigma_cell + M max(0, -eps_r)
/// The lateral stress held on the specimen grows as it bulges, while the laboratory reports the
/// cell pressure; M = 2 E_m t/D of a membrane of modulus E_m and thickness t on a diameter D.
/// Triaxial tests only. One-sided, vanishes at M = 0. [Henkel & Gilbert 1952]
EffectEntry MembraneStiffness();

}  // namespace calib::dem
