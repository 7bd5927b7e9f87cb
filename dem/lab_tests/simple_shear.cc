// `simple_shear`: the top displaced over the bottom at constant normal stress or constant volume.
#include "dem/lab_tests/shared/element_test.h"

namespace calib::dem {
namespace {

CellGoal Plan(const ElementTestContext& context, double shear_strain) {
  const AxisGoal fixed{.mode = AxisGoal::Mode::kStrain, .value = 0};
  const AxisGoal loaded{.mode = AxisGoal::Mode::kStress, .value = context.axial_stress};
  CellGoal goal{{fixed, fixed, context.settings.at("constant_volume") != 0 ? fixed : loaded}};
  goal.shear_strain = shear_strain;
  return goal;
}

ParameterInfo ConstantVolume() {
  ParameterInfo info;
  info.name = "constant_volume";
  info.unit = "1";
  info.max = 1;
  info.whole = true;
  info.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  info.default_value = 0;
  info.description = "0: the normal stress is held; 1: the height is";
  return info;
}

}  // namespace

/// The periodic cell is sheared along x over its height (Lees-Edwards boundaries along z), without
/// strain along x and y. The normal (axial) stress keeps the value of the end of consolidation, or,
/// with constant_volume 1, the height does. Shear strain is the displacement of the top over the
/// height at the end of consolidation, as a direct simple shear device gives it (ASTM D6528).
/// [Lees & Edwards 1972]
TestEntry SimpleShear() {
  return {
      .info = {.name = "simple_shear",
               .description =
                   "Periodic cell, isotropic compression to confining_pressure (or to "
                   "initial_stress), then shear strain driven through the control path without "
                   "lateral strain, at constant normal stress or constant volume; strain may "
                   "turn back. Fails when the normal stress cannot be held (a stage never "
                   "settles) or is lost",
               .settings = {ConfiningPressure(), ConstantVolume()},
               .observables = {"shear_strain", "shear_stress", "axial_stress", "shear_stress_ratio",
                               "axial_strain", "volumetric_strain", "lateral_stress", "mean_stress",
                               "porosity", "void_ratio", "coordination_number"},
               .control = "shear_strain",
               .may_reverse = true,
               .reference = "Lees & Edwards, J. Phys. C 5 (1972) 1921; ASTM D6528",
               .one_pressure = true},
      .place = 50,
      .procedure = CellProcedure(&Plan)};
}

}  // namespace calib::dem
