#pragma once
// Evidence and posterior draws of every model that competes for a measurement.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/model_space.h"
#include "inference/evidence/adaptive_importance.h"

namespace calib::inference {

/// What was measured with the tests of a set. Repeats of a test on other specimens are one
/// measurement, since the emulator errs in all of them alike: densities of all specimens and of
/// their mean differ by a factor that all models share.
struct MeasuredSet {
  const DiagnosisSet* set = nullptr;  ///< not null
  Eigen::VectorXd z{};                ///< q: coordinates, the mean over specimens
  int specimens = 1;                  ///< >= 1
  /// Effects that the set's emulator has; the space's models have no others.
  PartOfColumns columns{};
  /// Its density divides: another entry, of more specimens or tests, holds this measurement too.
  bool taken_out = false;
};

/// How ModelEvidences goes about it.
struct EvidenceOptions {
  CubeSamplingOptions sampling{};  ///< seed, sizes
  int draws = 200;                 ///< of each posterior, >= 2
  int realisations = 64;           ///< of the emulators, >= 2
  int first = 0;                   ///< place of the space's first model in a longer list, >= 0
};

/// What a model says of a measurement.
struct ModelEvidence {
  EffectModel model{};
  EvidenceEstimate evidence{};  ///< error: that of sampling
  double tail = 0;              ///< largest ParetoTailIndex of its signs
  double best = 0;              ///< largest log density met
  /// Posterior draws, equally weighted.
  DesignPoints draws{};
  Eigen::VectorXd tau{};  ///< of each draw; none of these alone
  /// R: ln of the evidence were the emulators these realisations, which all models share; their
  /// mean in the evidence itself is `evidence`.
  Eigen::VectorXd realised{};
};

/// Evidence of each model of the space, in its order: the likelihood of all measured sets (on
/// specimens of their own), averaged over the prior on the base parameters' box. Signs of two-sided
/// effects are integrated one by one. Deterministic in options.sampling.seed; a model's numbers do
/// not depend on which others compete but for their place in the list.
/// Errors: INVALID_ARGUMENT for a space that is not valid, or sets and measurements that do not
/// fit.
absl::StatusOr<std::vector<ModelEvidence>> ModelEvidences(const std::vector<MeasuredSet>& measured,
                                                          const ModelSpace& space,
                                                          const EvidenceOptions& options = {});

/// The same under each of several priors on strengths (K each), from one set of points: the space's
/// own prior is the widest, and under a narrower one a point counts by the ratio of both densities.
/// Points are half as many in a range half as long: the errors say so. Errors: INVALID_ARGUMENT
/// besides for a prior that is not within the space's, or has no length.
absl::StatusOr<std::vector<std::vector<ModelEvidence>>> ModelEvidencesUnder(
    const std::vector<MeasuredSet>& measured, const ModelSpace& space,
    const std::vector<std::vector<StrengthPrior>>& priors, const EvidenceOptions& options = {});

}  // namespace calib::inference
