#pragma once
// Probabilities of models and effects from evidences, and the three levels of the answer: family,
// alone, credible set. Pure functions.

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/model_evidence.h"

namespace calib::inference {

/// What is probable after a measurement, under one prior on strengths.
struct EffectProbabilities {
  Eigen::VectorXd model{};      ///< of each model; sums to one
  Eigen::VectorXd inclusion{};  ///< K: of the models that have the effect
  /// K: of the same, each model's divided equally among its effects; with the two below sums to
  /// one.
  Eigen::VectorXd share{};
  double adequate = 0;       ///< of the base model
  double none_of_these = 0;  ///< of what no effect of the library explains
  /// K: standard deviation of `inclusion` over what the emulators do not know: further runs may
  /// move it by as much.
  Eigen::VectorXd inclusion_sd{};
};

/// Probabilities from evidences and prior shares, averaged over the sampling errors of the
/// evidences (ModelProbabilities). Errors: INVALID_ARGUMENT for evidences that do not fit the
/// space's models or where none is finite.
absl::StatusOr<EffectProbabilities> ProbabilitiesOf(const std::vector<ModelEvidence>& evidence,
                                                    const ModelSpace& space);

/// Where the runs of a design lie: what an emulator knows.
struct DesignRange {
  Eigen::VectorXd base_low{}, base_high{};  ///< d
  /// K: largest strength to either side, >= 0; infinite where the effect itself ends there.
  Eigen::VectorXd strength_high{}, negative_high{};
};

/// The range of these runs.
DesignRange RangeOf(const DesignPoints& runs);

/// K: part of the posterior of the models with the effect that lies where there are no runs: a
/// strength beyond the largest or within its last hundredth, or a base parameter beyond its range
/// or within a hundredth of it from an end (the largest of these parts). A posterior that has piled
/// up at an end of its prior counts as one beyond. 0 for an effect without draws.
Eigen::VectorXd BeyondDesign(const std::vector<ModelEvidence>& evidence,
                             const EffectProbabilities& probabilities, const DesignRange& range);

/// Chance, by Fisher's law, that the mean of fresh runs at one point, or at points close together,
/// lies as far from the emulator's as these do, had it been right there: errors of the emulator,
/// which the runs share, packings, runs. in: set with coordinates; points n >= 1; packing n
/// numbers, of new packings, equal for runs on
///     one; histories n x T
double VerificationChance(const DiagnosisSet& set, const DesignPoints& points,
                          const std::vector<int>& packing, const Eigen::MatrixXd& histories);

/// Effects that these tests hardly tell apart: pairs within `degrees` or called kin, joined to
/// groups so that every two of a group are such a pair (closest first); each effect is in one, in
/// the order of their first.                                    [complete linkage: Sorensen 1948]
std::vector<std::vector<int>> Families(const Eigen::MatrixXd& angles,
                                       const std::vector<std::pair<int, int>>& kin,
                                       double degrees = 25);

/// Levels of the answer. Sources: a statement that is wrong once in twenty times.
struct AnswerLevels {
  double family = 0.95;        ///< of a family
  double alone = 0.95;         ///< of an effect that is named
  double sure = 0.99;          ///< below it "or something alike that this library lacks" is said
  double set = 0.95;           ///< of the credible set
  double unexplained = 0.5;    ///< of none of these
  double beyond = 0.05;        ///< largest part of the posterior beyond the design
  double verification = 0.01;  ///< smallest chance of the verification runs
};

/// Why an effect that is probable enough is not named.
enum class NotNamed {
  kOtherPrior,    ///< not so under every prior on strengths
  kBeyondDesign,  ///< the posterior lies where there are no runs
  kVerification,  ///< fresh runs miss the emulator there
};

/// Entries of a credible set.
struct CredibleEntry {
  int effect = 0;  ///< kAdequate, kNoneOfThese or an effect
  double share = 0;
  static constexpr int kAdequate = -1, kNoneOfThese = -2;
};

struct ProbableFamily {
  std::vector<int> effects{};
  double probability = 0;  ///< that at least one of them acts
};

/// The answer in three levels.
struct DiagnosisAnswer {
  std::vector<ProbableFamily> families{};  ///< at AnswerLevels::family or more
  std::vector<int> alone{};                ///< effects that are named
  bool sure = false;                       ///< all named ones at AnswerLevels::sure
  std::vector<std::pair<int, NotNamed>> not_named{};
  std::vector<CredibleEntry> set{};  ///< largest first
  bool unexplained = false;
};

/// What the answer rests on.
struct AnswerBasis {
  /// Under each prior on strengths, the reference first; at least one.
  std::vector<EffectProbabilities> widths{};
  std::vector<Eigen::VectorXd> beyond{};     ///< BeyondDesign under each
  std::vector<std::vector<int>> families{};  ///< Families
  /// K: VerificationChance at the optimum of what would be named; 1 where none was made.
  Eigen::VectorXd verification{};
};

/// The answer by these levels. Errors: INVALID_ARGUMENT for sizes that do not fit.
absl::StatusOr<DiagnosisAnswer> AnswerOf(const AnswerBasis& basis,
                                         const std::vector<EffectModel>& models,
                                         const AnswerLevels& levels = {});

}  // namespace calib::inference
