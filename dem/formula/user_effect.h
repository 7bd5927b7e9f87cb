#pragma once
// An effect that a user writes as a formula in the campaign file: what it changes, and the
// quantities it may speak of.

#include <span>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

/// A number that a formula may speak of, or change.
struct FormulaQuantity {
  std::string name;
  std::string unit;  ///< SI
  std::string description;
};

/// What a formula knows of one contact when it is evaluated, the same whichever of the two grains
/// comes first. What it knows of the specimen is in StageQuantities(). The span lives as long as
/// the program; thread-safe, as all functions here.
std::span<const FormulaQuantity> ContactQuantities();

/// What a formula at contacts knows of the specimen as a whole, in tests in the periodic cell.
/// During consolidation stresses are those that the specimen is compressed to and strains are zero;
/// later all are at most 20 time steps old.
std::span<const FormulaQuantity> StageQuantities();

/// What a formula of kind "measurement" knows: the readings of tests in the periodic cell.
std::span<const FormulaQuantity> ReadingQuantities();

/// Targets of formulas of kind "contact". A formula that scales may change normal_force and
/// friction_coefficient only, one that adds all but friction_coefficient.
std::span<const FormulaQuantity> ContactTargets();

/// Targets of formulas of kind "measurement": all readings but the strains that drive tests.
std::span<const FormulaQuantity> ReadingTargets();

/// Kind of an effect with this target: "measurement" where it is one of ReadingTargets(), else
/// "contact".
std::string KindOfTarget(const std::string& target);

/// Names that the formula of an effect of this kind ("contact", "measurement") may use beside its
/// parameters, in the order in which they are handed to the Formula.
std::vector<FormulaQuantity> QuantitiesOf(const std::string& kind);

/// The names of QuantitiesOf() followed by those of the parameters.
std::vector<std::string> FormulaNames(const UserEffect& effect);

/// Whether the effect acts at contacts and its formula speaks of a velocity: such an effect is
/// viscous and off during consolidation.
bool IsViscous(const UserEffect& effect);

/// Whether the effect acts at contacts and its formula speaks of one of StageQuantities().
bool NeedsStage(const UserEffect& effect);

/// What is wrong with an effect of a user, a sentence each; empty: it can run. Names of effects and
/// parameters are letters, digits and _, begin with a letter and are used once. name_taken: the
/// build has an effect of the same name.
std::vector<std::string> UserEffectProblems(const UserEffect& effect, bool name_taken);

/// What the formula gives where its parameters are at their null, if that is not exactly no effect,
/// or that it is finite nowhere, as the rest of a sentence about the formula; empty: neither.
/// Precondition: UserEffectProblems() finds nothing and parameters without a default have a default
/// prior.
std::string NullProblem(const UserEffect& effect);

}  // namespace calib::dem
