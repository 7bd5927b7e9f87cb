#pragma once
// From the packing as given to the stress and density at which a test begins.

#include <optional>

#include "absl/status/status.h"
#include "dem/dynamics/quasi_static.h"
#include "dem/model/scenario.h"
#include "dem/model/test_entry.h"

namespace calib::dem {

/// What a specimen is to be when its test begins. SI units.
struct ConsolidationPlan {
  double pressure = 0;          ///< isotropic, > 0 [Pa]
  Consolidation consolidation;  ///< friction while compressing, or the porosity to reach
  std::optional<InitialStress> initial_stress;
  Preparation preparation;  ///< by effects of kind "initial_state"
};

/// Difference within which a porosity counts as reached [-]. Chosen;
/// GeneratePacking.HitsPorosityAndPressure holds specimens to it.
inline constexpr double kPorosityTolerance = 1e-4;

/// Compresses isotropically through the pressures 1-2-5 x 10^k between a twentieth of the target
/// and the target (each settled, so that results do not hang on one long stage), lowers friction
/// until the porosity holds if one is asked for, restores the model's friction, and moves to the
/// initial stress. Where both a porosity and an initial stress are asked for, the porosity is that
/// after the move: the way there is repeated from the compressed state until it holds within
/// kPorosityTolerance. `end` says how it ended. Errors: OUT_OF_RANGE with the attainable range when
/// lowering friction cannot reach the porosity.
absl::Status Consolidate(const ConsolidationPlan& plan, QuasiStatic& stages, StageEnd& end);

/// Lowers friction step by step at constant isotropic pressure, settling in between, until the
/// porosity passes a threshold near the target; there the friction that the assembly came with is
/// put back, which stops the compaction. A state that came out too loose is where the next attempt
/// starts; one too dense is discarded, and the next attempt stops earlier and goes more gently.
/// Ends within kPorosityTolerance, with the original friction. Errors: OUT_OF_RANGE with the
/// attainable range, or with the two states between which a small packing jumps. Precondition:
/// settled at the pressure.
absl::Status LowerFrictionToPorosity(double porosity, double pressure, QuasiStatic& stages,
                                     StageEnd& end);

}  // namespace calib::dem
