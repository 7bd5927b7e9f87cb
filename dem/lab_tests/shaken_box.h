#pragma once
// `shaken_box`: a large grain among small ones in a shaken box.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry ShakenBox();

}  // namespace calib::dem
