#include "dem/simulation/element_test_setup.h"

#include <algorithm>
#include <cmath>

#include "dem/catalog/registry.h"

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

bool Chosen(const Scenario& scenario, const EffectEntry& effect) {
  const auto& chosen = scenario.model.effects;
  return std::find(chosen.begin(), chosen.end(), effect.info.name) != chosen.end();
}

ParameterSet ParametersOf(const Scenario& scenario, const EffectEntry& effect) {
  return ResolveParameters(effect.info.parameters, effect.info.name + ".",
                           scenario.model.parameters);
}

}  // namespace

const ElementTestEntry& ElementTestNamed(const std::string& test) {
  const auto entries = ElementTestEntries();
  return *std::find_if(entries.begin(), entries.end(),
                       [&](const ElementTestEntry& entry) { return entry.info.name == test; });
}

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

Alterations AlterationsOf(const Scenario& scenario) {
  Alterations result{.apparatus = {}, .preparation = PreparationOf(scenario)};
  if (ElementTestNamed(scenario.test).rig_load == RigLoad::kNone) {
    return result;
  }
  for (const EffectEntry& effect : EffectEntries()) {
    if (effect.alter != nullptr && Chosen(scenario, effect)) {
      effect.alter(ParametersOf(scenario, effect), result.apparatus);
    }
  }
  return result;
}

Preparation PreparationOf(const Scenario& scenario) {
  Preparation result;
  for (const EffectEntry& effect : EffectEntries()) {
    if (effect.prepare != nullptr && Chosen(scenario, effect)) {
      effect.prepare(ParametersOf(scenario, effect), result);
    }
  }
  return result;
}

}  // namespace calib::dem
