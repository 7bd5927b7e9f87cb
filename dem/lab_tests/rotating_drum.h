#pragma once
// `rotating_drum`: the slope of grains in a turning drum.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry RotatingDrum();

}  // namespace calib::dem
