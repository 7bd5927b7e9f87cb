#include "dem/model/staging.h"

#include <algorithm>
#include <cmath>

namespace calib::dem {
namespace {

/// Inertial number I = rate d sqrt(rho/p) of an unset rate: curves no longer depend on it beyond
/// their scatter (dem/VERIFICATION.md, rate study). [GDR MiDi 2004: quasi-static below about 1e-3]
constexpr double kInertialNumber = 5e-4;
constexpr double kStep = 0.002;
constexpr double kAdaptiveStep = 0.02;  ///< settled at every reading anyway
constexpr double kDampingLoading = 0.2;
constexpr double kDampingSettling = 0.9;
constexpr double kAdaptiveDampingSettling = 0.7;  ///< fewest steps of 0.5, 0.7 and 0.9
constexpr double kUnbalanced = 5e-4;

double PressureScale(const Scenario& scenario) {
  const double pressure = scenario.settings.at("confining_pressure");
  return scenario.initial_stress ? std::min({pressure, scenario.initial_stress->axial,
                                             scenario.initial_stress->lateral})
                                 : pressure;
}

}  // namespace

Staging ResolveStaging(const Scenario& scenario, double mean_diameter) {
  const Staging& given = scenario.staging;
  const bool adaptive = given.adaptive && !scenario.loading_rate;
  const double quasi_static_rate =
      kInertialNumber / mean_diameter * std::sqrt(PressureScale(scenario) / scenario.model.density);
  return {.rate = given.rate.value_or(quasi_static_rate),
          .step = given.step.value_or(adaptive ? kAdaptiveStep : kStep),
          .damping_loading = given.damping_loading.value_or(kDampingLoading),
          .damping_settling = given.damping_settling.value_or(adaptive ? kAdaptiveDampingSettling
                                                                       : kDampingSettling),
          .unbalanced = given.unbalanced.value_or(kUnbalanced),
          .adaptive = adaptive};
}

}  // namespace calib::dem
