#pragma once
// Catalogue entries of the parameters that every contact law has.

#include <map>
#include <string>

#include "dem/model/effect.h"

namespace calib::dem {

/// Young's modulus of the grains (a contact modulus for linear springs) [Pa].
ParameterInfo YoungModulus();
ParameterInfo PoissonRatio();

/// Angle phi_mu of friction between grains [rad]; this or FrictionCoefficient() is given.
ParameterInfo FrictionAngle();

/// tan(phi_mu) [-], alternative to the angle.
ParameterInfo FrictionCoefficient();

/// tan(phi_mu) from whichever of the two is there. Precondition: one of them is.
double SlidingFriction(const std::map<std::string, double>& parameters);

}  // namespace calib::dem
