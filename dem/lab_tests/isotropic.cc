// `isotropic`: the mean stress driven, all three axes at the same stress.
#include "dem/lab_tests/shared/element_test.h"

namespace calib::dem {
namespace {

CellGoal Plan(const ElementTestContext& /*context*/, double mean_stress) {
  const AxisGoal goal{.mode = AxisGoal::Mode::kStress, .value = mean_stress};
  return {{goal, goal, goal}};
}

}  // namespace

TestEntry Isotropic() {
  return {.info = {.name = "isotropic",
                   .description =
                       "Periodic cell, isotropic compression to confining_pressure (the start "
                       "pressure), then the mean stress driven through the control path [Pa, "
                       "positive] with all three normal stresses equal; unload-reload by a "
                       "path that turns. Fails when the packing cannot be brought to the start "
                       "pressure or a porosity asked for, when grains overlap by more than half "
                       "the smaller radius, or when the specimen does not come to rest",
                   .settings = {ConfiningPressure()},
                   .observables = ElementObservables(),
                   .control = "mean_stress",
                   .may_reverse = true,
                   .reference = "Cheng et al. 2018, sec. 2.2",
                   .stress_driven = true},
          .place = 10,
          .procedure = CellProcedure(&Plan)};
}

}  // namespace calib::dem
