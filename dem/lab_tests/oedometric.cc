// `oedometric`: axial strain or axial stress driven, no lateral strain.
#include "dem/lab_tests/shared/element_test.h"

namespace calib::dem {
namespace {

CellGoal Plan(const ElementTestContext& context, double control) {
  const AxisGoal fixed{.mode = AxisGoal::Mode::kStrain, .value = 0};
  const auto mode = context.stress_driven ? AxisGoal::Mode::kStress : AxisGoal::Mode::kStrain;
  return {{fixed, fixed, AxisGoal{.mode = mode, .value = control}}};
}

}  // namespace

TestEntry Oedometric() {
  return {.info = {.name = "oedometric",
                   .description =
                       "Periodic cell, isotropic compression to confining_pressure (the start "
                       "pressure), then axial strain, or axial stress [Pa, positive] where that is "
                       "the control, driven through the control path without "
                       "lateral strain; unload-reload by a path that turns. Fails when the packing "
                       "cannot be brought to the start pressure or a porosity asked for, when "
                       "grains overlap by more than half the smaller radius, when the cell becomes "
                       "shorter than two grains, or when the specimen does not come to rest",
                   .settings = {ConfiningPressure()},
                   .observables = ElementObservables(),
                   .control = "axial_strain",
                   .may_reverse = true,
                   .reference = "Cheng et al. 2019, sec. 4",
                   .rig_load = RigLoad::kAxial,
                   .stress_control = "axial_stress"},
          .place = 20,
          .procedure = CellProcedure(&Plan)};
}

}  // namespace calib::dem
