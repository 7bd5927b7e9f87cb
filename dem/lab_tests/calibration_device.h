#pragma once
// `calibration_device`: hopper, slide and pile in one run.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry CalibrationDevice();

}  // namespace calib::dem
