#pragma once
// Tests of one specimen whose boundary is the periodic cell: per axis a strain or a stress for each
// control target.

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dem/lab_tests/shared/test_run.h"
#include "dem/model/test_entry.h"

namespace calib::dem {

/// What one axis of the cell does until a target is reached.
struct AxisGoal {
  enum class Mode { kStrain, kStress };
  Mode mode = Mode::kStrain;
  double value = 0;  ///< logarithmic strain from the end of consolidation [-], or stress [Pa];
                     ///< compression positive
};

/// Goals of the axes x and y, lateral, and z, axial.
struct CellGoal : std::array<AxisGoal, 3> {
  double shear_strain = 0;  ///< displacement of the top along x over the height at the end of
                            ///< consolidation [-]
};

/// What a plan may know beside the control target.
struct ElementTestContext {
  std::map<std::string, double> settings;  ///< of the test, defaults filled in
  double lateral_stress = 0;               ///< at the end of consolidation [Pa]
  double axial_stress = 0;                 ///< at the end of consolidation [Pa]
  bool stress_driven = false;              ///< IsStressDriven()
};

/// Goal of the cell for one value of the control observable. Pure.
using PlanElementTest = CellGoal (*)(const ElementTestContext& context, double target);

/// The procedure of an element test that walks the specimen through the path of its control by a
/// plan.
std::function<absl::StatusOr<Summary>(const TestRun&)> CellProcedure(PlanElementTest plan);

/// Names of the observables that every element test gives, in the order in which its states hold
/// them; those of dem/measure/observables come last.
std::vector<std::string> ElementObservables();

/// Catalogue entry of the setting confining_pressure [Pa] > 0, the isotropic stress at which
/// consolidation ends.
ParameterInfo ConfiningPressure();

}  // namespace calib::dem
