#pragma once
// `triaxial_drained`: axial strain driven, lateral stress held.

#include "dem/catalog/registry.h"

namespace calib::dem {

ElementTestEntry TriaxialDrained();

}  // namespace calib::dem
