// `triaxial_undrained`: axial strain driven at constant volume.
#include "dem/lab_tests/shared/element_test.h"

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

/// The pores are taken as full of an incompressible liquid: the lateral strain is -eps_a/2 (in
/// logarithmic measure), so that the volume at every settled stage is that of the end of
/// consolidation, and grain stresses are the effective stresses. The excess pore pressure is what
/// keeps the total lateral stress at the cell pressure.
/// [Sitharam et al. 2002; Thornton 2000, sec. 4]
TestEntry TriaxialUndrained() {
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
                                "Geomech. 26 (2002) 1167",
                   .rig_load = RigLoad::kDeviatoric},
          .place = 40,
          .procedure = CellProcedure(&Plan)};
}

}  // namespace calib::dem
