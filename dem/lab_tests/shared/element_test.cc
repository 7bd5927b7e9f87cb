#include "dem/lab_tests/shared/element_test.h"

#include "dem/lab_tests/shared/element_test_run.h"
#include "dem/measure/observables.h"

namespace calib::dem {

std::vector<std::string> ElementObservables() {
  std::vector<std::string> names = {
      "axial_strain",   "volumetric_strain", "lateral_strain",    "axial_stress",
      "lateral_stress", "mean_stress",       "deviatoric_stress", "stress_ratio",
      "q_over_p",       "porosity",          "void_ratio",        "coordination_number"};
  for (const ObservableEntry& entry : FurtherObservables()) {
    names.push_back(entry.info.name);
  }
  return names;
}

std::function<absl::StatusOr<Summary>(const TestRun&)> CellProcedure(PlanElementTest plan) {
  return [plan](const TestRun& run) { return RunElementTest(run, plan); };
}

ParameterInfo ConfiningPressure() {
  ParameterInfo info;
  info.name = "confining_pressure";
  info.unit = "Pa";
  info.min = 0;
  info.min_open = true;
  info.max = 1e10;
  info.default_prior = {.kind = "log_uniform", .min = 1e4, .max = 1e7};
  info.description = "isotropic stress to which the packing is compressed before loading";
  return info;
}

}  // namespace calib::dem
