#pragma once
// `apparatus_compliance`: the loading frame shortens too.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   reading of axial strain = eps + x/K
/// x is the load on the frame since the start of loading: q in triaxial tests, sigma_a - sigma_a0
/// in oedometric ones. The reading drives the test: a stage ends when it, not the specimen's
/// strain, has reached the control. In oedometric tests volume follows the reading, in triaxial
/// ones it is measured apart. One-sided, vanishes at compliance 1/K = 0. [Jardine, Symes & Burland
/// 1984]
EffectEntry ApparatusCompliance();

}  // namespace calib::dem
