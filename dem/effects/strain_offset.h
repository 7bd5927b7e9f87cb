#pragma once
// `strain_offset`: bedding and seating errors that close under load.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   reading of axial strain = eps + d0 (1 - exp(-x/q0)),   x >= 0 as in apparatus_compliance
/// Gaps between platens and specimen close as load comes on: strain that the specimen does not
/// have, most of it below q0. Drives the test like apparatus_compliance. One-sided, vanishes at
/// d0 = 0. [Jardine, Symes & Burland 1984; Goto et al. 1991]
EffectEntry StrainOffset();

}  // namespace calib::dem
