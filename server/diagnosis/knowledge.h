#pragma once
// What base and design runs so far say of a measurement: an emulator in units in which each effect
// is just seen, evidences of the models that compete, their probabilities. Pure functions of the
// runs and the seed.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/effect_probabilities.h"
#include "inference/diagnosis/model_evidence.h"
#include "server/diagnosis/base_region.h"
#include "server/diagnosis/run_matrices.h"

namespace calib::diagnosis {

/// What stays the same while a design grows.
struct KnownBefore {
  BaseRuns base;
  BaseRegion region;
  inference::JointPrior prior;  ///< of the base parameters
  std::uint64_t seed = 0;
};

/// An emulator of the base's and the design's runs.
struct Knowledge {
  DesignRows rows;  ///< units: strengths at which a measurement shows the effect (lambda = 21)
  PartOfRace part;  ///< entries that the emulator has, K of them
  std::vector<std::pair<int, std::string>> out{};  ///< entries that it has not, and why
  std::shared_ptr<const inference::DiagnosisSet> set;
  Eigen::VectorXd z{};             ///< q: the measurement
  inference::DesignRange range{};  ///< of the runs, of the kept entries
  Eigen::MatrixXd angles{};        ///< K x K, degrees
  /// K: whether lambda = 21 is reached at a strength that the entry can have, not beyond ten times
  /// what the catalogue tries.
  std::vector<bool> reached{};
  std::vector<std::string> warnings{};
};

/// Learns from all batches. guess: rows with units near the right ones. with_flat: whether entries
/// that no strength of a design shows (lambda below 4 and twice chance) are taken out; a scout does
/// not know.
/// Errors: those of DiagnosisSet::Fit.
absl::StatusOr<Knowledge> Learn(const KnownBefore& before, const DesignRows& guess,
                                const std::vector<EndedBatch>& batches, bool with_flat);

/// Learns from the runs of the base alone, and from what the batches say of numerical choices.
/// rows: of the values of the batches. Errors: those of DiagnosisSet::Fit.
absl::StatusOr<Knowledge> LearnBase(const KnownBefore& before, const DesignRows& rows,
                                    const std::vector<EndedBatch>& batches);

/// How much is spent on evidences. kToChoose: whom further runs would tell apart, under the
/// first of kStrengthWidths alone; kToAnswer: what is said, under all of them.
enum class Effort { kToChoose, kToAnswer };

/// Evidences and what follows, under each width that was asked for.
struct Asked {
  inference::ModelSpace space{};
  std::vector<std::vector<inference::ModelEvidence>> evidence{};
  std::vector<inference::EffectProbabilities> probabilities{};
};

/// Measurements in further tests, and who competes for them and the first ones together.
struct FurtherMeasured {
  std::vector<inference::MeasuredSet> sets{};
  std::vector<inference::EffectModel> models{};  ///< of kept entries; the base model the first
  Eigen::VectorXd log_prior{};                   ///< ModelSpace::log_prior
};

/// Evidences alone, for the base's fitted tests. Errors: those of ModelEvidencesUnder.
absl::StatusOr<Asked> AskEvidences(const KnownBefore& before, const Knowledge& knowledge,
                                   Effort effort);

/// further: null where there are the base's fitted tests alone, for which all models compete.
/// Errors: those of AskEvidences and ProbabilitiesOf.
absl::StatusOr<Asked> Ask(const KnownBefore& before, const Knowledge& knowledge, Effort effort,
                          const FurtherMeasured* further = nullptr);

/// Names of the effects of a model of kept entries, each once.
std::vector<std::string> EffectsNamed(const Knowledge& knowledge,
                                      const inference::EffectModel& model);

/// Of a model's posterior draws the one that the measurement is most probable at, 1 row. in: draws,
/// at least one
inference::DesignPoints BestDraw(const Knowledge& knowledge, const inference::DesignPoints& draws);

/// n: squares of a measurement's distances (z: its coordinates in the set) from points, over errors
/// and what is not known there.
Eigen::VectorXd SquaresOfMisfit(const inference::DiagnosisSet& set, const Eigen::VectorXd& z,
                                const inference::DesignPoints& points);
/// n: the same over what these are at one point, `at`, so that models are held to one measure.
Eigen::VectorXd SquaresAsAt(const Knowledge& knowledge, const inference::DesignPoints& at,
                            const inference::DesignPoints& points);

/// Chance that a right model misses a measured history (T, on the set's scale) by as much as the
/// closest of these points does: the smaller of that of the coordinates and that of what they leave
/// out, doubled (Bonferroni). `fitted`: parameters that were free. in: a set with coordinates;
/// points n >= 1, of its emulator
double ChanceOfMisfit(const inference::DiagnosisSet& set, const Eigen::VectorXd& history,
                      const inference::DesignPoints& points, int fitted);

}  // namespace calib::diagnosis
