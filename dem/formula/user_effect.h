#pragma once
// An effect that a user writes as a formula in the campaign file: what it changes, and the
// quantities it may speak of.

#include <span>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

/// Something that a formula may speak of, or change.
struct FormulaQuantity {
  std::string name;
  std::string unit;  ///< SI
  std::string description;
};

/// What is known of one contact when the formula is evaluated: the same whichever of the two grains
/// comes first. Not of it: StageQuantities().
std::span<const FormulaQuantity> ContactQuantities();

/// What is known of the specimen as a whole, in tests in the periodic cell: during consolidation
/// stresses are those it is compressed to and strains zero, then as of at most 20 time steps ago.
std::span<const FormulaQuantity> StageQuantities();

/// Readings of the tests in the periodic cell.
std::span<const FormulaQuantity> ReadingQuantities();

/// What a formula of a contact may change. `scales` only normal_force and friction_coefficient,
/// `adds` all but the latter.
std::span<const FormulaQuantity> ContactTargets();

/// Readings that a formula may change: all but strains that drive tests.
std::span<const FormulaQuantity> ReadingTargets();

/// Kind of an effect with this target: "measurement" of ReadingTargets(), else "contact".
std::string KindOfTarget(const std::string& target);

/// Names that the formula of an effect of this kind ("contact", "measurement") may use beside its
/// parameters, in the order in which they are handed to the Formula.
std::vector<FormulaQuantity> QuantitiesOf(const std::string& kind);

/// The names of QuantitiesOf() followed by those of the parameters.
std::vector<std::string> FormulaNames(const UserEffect& effect);

/// Whether the formula speaks of a velocity: such an effect is viscous, off during consolidation.
bool IsViscous(const UserEffect& effect);

/// Whether the formula speaks of a StageQuantity and acts at contacts.
bool NeedsStage(const UserEffect& effect);

/// What is wrong with it, a sentence each; empty: it can run. Names of effects and parameters are
/// letters, digits and _, begin with a letter and are nobody else's; name_taken: the build has an effect of its name.
std::vector<std::string> UserEffectProblems(const UserEffect& effect, bool name_taken);

/// What the formula is where its parameters are at their null, if not exactly nothing, or that it
/// is finite nowhere; the rest of a sentence about it, empty: neither. Precondition: it can run and
/// parameters without a default have a default prior.
std::string NullProblem(const UserEffect& effect);

}  // namespace calib::dem
