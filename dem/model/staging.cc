#include "dem/model/staging.h"

#include <algorithm>
#include <cmath>

namespace calib::dem {
namespace {

/// Inertial number I = rate d sqrt(rho/p) of an unset rate [-]. Measured: curves no longer depend
/// on it beyond their scatter (dem/VERIFICATION.md, rate study); quasi-static is below about 1e-3.
/// [GDR MiDi 2004]
constexpr double kInertialNumber = 5e-4;
/// Axial strain between two settlings [-]. Measured: with 0.001 the stress ratio differs by 0.14 %
/// (dem/VERIFICATION.md, step and rate in the suite).
constexpr double kStep = 0.002;
/// Axial strain between two settlings of adaptive staging [-]. Chosen: every reading is settled
/// anyway.
constexpr double kAdaptiveStep = 0.02;
/// Local damping while straining and while settling [-]. Chosen: those of the curves of YADE that
/// the engine is compared with (dem/VERIFICATION.md, curves of YADE).
constexpr double kDampingLoading = 0.2;
constexpr double kDampingSettling = 0.9;
/// Local damping while settling in adaptive staging [-]. Chosen: of 0.5, 0.7 and 0.9 the one with
/// the fewest steps.
constexpr double kAdaptiveDampingSettling = 0.7;
/// Mean unbalanced over mean contact force that ends a settling [-]. Chosen: that of the curves of
/// YADE.
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
