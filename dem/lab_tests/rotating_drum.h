#pragma once
// `rotating_drum`: the slope of grains in a turning drum.

#include <string>

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry RotatingDrum();

/// Why grains cannot tumble at a speed [rad/s] in a drum of an inner diameter [m] > 0, in a
/// sentence; empty: they can. From a Froude number omega^2 R / g of 1 on they are carried around.
/// gravity [m/s^2] > 0
std::string CentrifugeProblem(double speed, double diameter, double gravity);

}  // namespace calib::dem
