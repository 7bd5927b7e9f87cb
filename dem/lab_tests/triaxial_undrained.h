#pragma once
// `triaxial_undrained`: axial strain driven at constant volume.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// The pores are taken as full of an incompressible liquid: the lateral strain is -eps_a/2 (in
/// logarithmic measure), so that the volume at every settled stage is that of the end of
/// consolidation, and grain stresses are the effective stresses. The excess pore pressure is what
/// keeps the total lateral stress at the cell pressure. [Sitharam et al. 2002; Thornton 2000, sec.
/// 4]
ElementTestEntry TriaxialUndrained();

}  // namespace calib::dem
