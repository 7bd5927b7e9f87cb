#pragma once
// `angle_of_repose`: a heap left by a lifted cylinder.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry AngleOfRepose();

}  // namespace calib::dem
