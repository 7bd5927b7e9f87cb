#pragma once
// Tests of one specimen whose boundary is the periodic cell: per axis a strain or a stress for each
// control target.

#include <array>
#include <map>
#include <string>
#include <vector>

#include "dem/catalog/catalog.h"

namespace calib::dem {

/// What one axis of the cell does until a target is reached.
struct AxisGoal {
  enum class Mode { kStrain, kStress };
  Mode mode = Mode::kStrain;
  double value = 0;  ///< logarithmic strain from the end of consolidation [-], or stress [Pa];
                     ///< compression positive
};

/// x, y lateral; z axial; and the displacement of the top along x over the height at the end of
/// consolidation [-].
struct CellGoal : std::array<AxisGoal, 3> {
  double shear_strain = 0;
};

/// What a plan may know beside the control target.
struct ElementTestContext {
  std::map<std::string, double> settings;  ///< of the test, defaults filled in
  double lateral_stress = 0;               ///< at the end of consolidation [Pa]
  double axial_stress = 0;                 ///< the same [Pa]
};

/// Goal of the cell for one value of the control observable. Pure.
using PlanElementTest = CellGoal (*)(const ElementTestContext& context, double target);

/// What loads the frame that strains the specimen, and with it where effects of the apparatus act.
enum class RigLoad {
  kNone,        ///< no axial loading frame
  kDeviatoric,  ///< q against the cell pressure; volume is measured apart
  kAxial,       ///< the axial stress; volume follows from the axial strain
};

/// Names of the tests of one specimen in the periodic cell, where effects of its grains' shape and
/// strength and of its preparation act.
std::vector<std::string> ElementTestNames();

/// Observables that every element test produces, in the order of their states.
std::vector<std::string> ElementObservables();

/// confining_pressure [Pa], the isotropic stress at which consolidation ends.
ParameterInfo ConfiningPressure();

}  // namespace calib::dem
