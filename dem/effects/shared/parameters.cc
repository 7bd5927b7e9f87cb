#include "dem/effects/shared/parameters.h"

namespace calib::dem {

ParameterInfo ReferencePressure(const std::string& description) {
  ParameterInfo pressure;
  pressure.name = "reference_pressure";
  pressure.unit = "Pa";
  pressure.max = 1e10;
  pressure.min_open = true;
  pressure.default_prior = {.kind = "log_uniform", .min = 1e4, .max = 1e7};
  pressure.default_value = 1e5;
  pressure.scale = {.pressure = 1};
  pressure.description = description;
  return pressure;
}

ParameterInfo WorkOfAdhesion() {
  ParameterInfo work;
  work.name = "work_of_adhesion";
  work.unit = "J/m^2";
  work.max = 1e6;
  work.default_prior = {.kind = "log_uniform", .min = 1e-3, .max = 10};
  work.null_value = 0;
  work.scale = {.pressure = 1, .diameter = 1};
  work.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  work.description =
      "W, energy to part two surfaces, per area (twice the surface energy of one material)";
  work.of_pairs = true;
  return work;
}

}  // namespace calib::dem
