#include "dem/contact/common_parameters.h"

#include <cassert>
#include <cmath>

#include "dem/elementary/functions.h"

namespace calib::dem {

ParameterInfo YoungModulus() {
  ParameterInfo info;
  info.name = "young_modulus";
  info.unit = "Pa";
  info.min = 1e4;
  info.max = 1e13;
  info.default_prior = {.kind = "log_uniform", .min = 1e8, .max = 1e11};
  info.description = "Young's modulus of the grains";
  return info;
}

ParameterInfo PoissonRatio() {
  ParameterInfo info;
  info.name = "poisson_ratio";
  info.unit = "1";
  info.min = 0;
  info.max = 0.5;
  info.default_prior = {.kind = "uniform", .min = 0, .max = 0.5};
  info.default_value = 0.2;
  info.description = "Poisson's ratio of the grains";
  return info;
}

ParameterInfo FrictionAngle() {
  ParameterInfo info;
  info.name = "friction_angle";
  info.unit = "rad";
  info.min = 0;
  info.max = 1.5;  // tan = 14; the tangent is infinite at pi/2
  info.default_prior = {.kind = "uniform", .min = 0.1, .max = 0.8};
  info.description = "angle phi_mu of friction between grains; |Fs| <= tan(phi_mu) Fn";
  return info;
}

ParameterInfo FrictionCoefficient() {
  ParameterInfo info;
  info.name = "friction_coefficient";
  info.unit = "1";
  info.min = 0;
  info.max = 14;
  info.default_prior = {.kind = "uniform", .min = 0.1, .max = 1.0};
  info.alternative_to = "friction_angle";
  info.description = "coefficient tan(phi_mu) of friction between grains";
  return info;
}

double SlidingFriction(const std::map<std::string, double>& parameters) {
  if (const auto it = parameters.find("friction_coefficient"); it != parameters.end()) {
    return it->second;
  }
  const auto angle = parameters.find("friction_angle");
  assert(angle != parameters.end());
  return Tangent(angle->second);
}

}  // namespace calib::dem
