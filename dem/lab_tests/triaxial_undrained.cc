#include "dem/lab_tests/triaxial_undrained.h"

namespace calib::dem {
namespace {

CellGoal Plan(const ElementTestContext& /*context*/, double axial_strain) {
  const AxisGoal lateral{.mode = AxisGoal::Mode::kStrain, .value = -0.5 * axial_strain};
  return {{lateral, lateral, AxisGoal{.mode = AxisGoal::Mode::kStrain, .value = axial_strain}}};
}

std::vector<std::string> Observed() {
  std::vector<std::string> names = ElementObservables();
  names.emplace_back("pore_pressure");
  return names;
}

}  // namespace

ElementTestEntry TriaxialUndrained() {
  return {.info = {.name = "triaxial_undrained",
                   .description =
                       "Periodic cell, isotropic compression to confining_pressure, then axial "
                       "strain driven through the control path at constant volume; stresses are "
                       "effective. Fails when the grains lose contact (no stress ratio is left) "
                       "or a stage never settles",
                   .settings = {ConfiningPressure()},
                   .observables = Observed(),
                   .control = "axial_strain",
                   .may_reverse = true,
                   .reference = "Sitharam, Dinesh & Shimizu, Int. J. Numer. Anal. Methods "
                                "Geomech. 26 (2002) 1167"},
          .plan = &Plan,
          .rig_load = RigLoad::kDeviatoric};
}

}  // namespace calib::dem
