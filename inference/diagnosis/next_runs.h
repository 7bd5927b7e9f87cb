#pragma once
// Which runs of the simulator would tell most about which model is right. Pure functions.

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/effect_probabilities.h"
#include "inference/diagnosis/model_evidence.h"

namespace calib::inference {

/// How NextRuns goes about it.
struct NextRunsOptions {
  int runs = 6;           ///< of a batch, >= 1
  double leading = 0.01;  ///< probability of a model that takes part
  int most_models = 10;   ///< of these, the most probable
  int draws = 8;          ///< of each model's posterior, >= 1
};

/// Runs in the order in which they were chosen.
struct ChosenRuns {
  std::vector<Eigen::Index> rows{};  ///< of the candidates
  /// nats about the model indicator that the runs so far give together, ascending; at least so
  /// much.
  std::vector<double> information{};
};

/// The batch, one run after the other, with the largest mutual information of its outputs and the
/// model indicator. A model that is right ties the emulator to the measurement: at each draw of its
/// posterior the coefficients are conditioned on z (a rank-one update per coordinate), so that
/// models disagree about what runs will show where the emulator is not sure. Outputs of a model are
/// taken for normal, and information is bounded from below by the distances of all pairs,
///   I >= -sum_i w_i ln sum_j w_j exp(-B_ij),  B the Bhattacharyya distance.
///                                                       [Kolchinsky & Tracey, Entropy 19 (2017)
///                                                       361, Eq. 10]
/// in: measured, the set that the runs are for and what was measured there; evidence and
/// probability
///     of each model; candidates, n >= 1 points
/// Errors: INVALID_ARGUMENT for what does not fit, or no model with draws.
absl::StatusOr<ChosenRuns> NextRuns(const MeasuredSet& measured,
                                    const std::vector<ModelEvidence>& evidence,
                                    const EffectProbabilities& probabilities,
                                    const DesignPoints& candidates,
                                    const NextRunsOptions& options = {});

/// Models that lead: those with draws and a probability of at least `least`, most probable first,
/// at most `most`.
std::vector<Eigen::Index> LeadingModels(const std::vector<ModelEvidence>& evidence,
                                        const EffectProbabilities& probabilities, double least,
                                        int most);

}  // namespace calib::inference
