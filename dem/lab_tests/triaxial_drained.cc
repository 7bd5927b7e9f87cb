// `triaxial_drained`: axial strain driven, lateral stress held.
#include "dem/lab_tests/shared/element_test.h"

namespace calib::dem {
namespace {

CellGoal Plan(const ElementTestContext& context, double axial_strain) {
  const AxisGoal lateral{.mode = AxisGoal::Mode::kStress, .value = context.lateral_stress};
  return {{lateral, lateral, AxisGoal{.mode = AxisGoal::Mode::kStrain, .value = axial_strain}}};
}

}  // namespace

TestEntry TriaxialDrained() {
  return {.info = {.name = "triaxial_drained",
                   .description =
                       "Periodic cell, isotropic compression to confining_pressure, then axial "
                       "strain driven through the control path while both lateral stresses "
                       "are held. Fails when the lateral stress cannot be held (a stage "
                       "never settles)",
                   .settings = {ConfiningPressure()},
                   .observables = ElementObservables(),
                   .control = "axial_strain",
                   .may_reverse = true,
                   .reference = "Cheng et al. 2018, sec. 4",
                   .one_pressure = true,
                   .rig_load = RigLoad::kDeviatoric},
          .place = 30,
          .procedure = CellProcedure(&Plan)};
}

}  // namespace calib::dem
