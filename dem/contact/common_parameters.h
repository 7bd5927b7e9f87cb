#pragma once
// Catalogue entries of the parameters that every contact law has.

#include <map>
#include <string>

#include "dem/model/effect.h"

namespace calib::dem {

/// Young's modulus of the grains (a contact modulus for linear springs) [Pa].
ParameterInfo YoungModulus();
/// Poisson's ratio of the grains [-].
ParameterInfo PoissonRatio();

/// Angle phi_mu of friction between grains [rad]; this or FrictionCoefficient() is given.
ParameterInfo FrictionAngle();

/// Coefficient tan(phi_mu) of friction between grains [-]; this or FrictionAngle() is given.
ParameterInfo FrictionCoefficient();

/// tan(phi_mu) [-] from friction_angle or friction_coefficient, whichever is among the parameters.
/// Precondition: one of them is.
double SlidingFriction(const std::map<std::string, double>& parameters);

}  // namespace calib::dem
