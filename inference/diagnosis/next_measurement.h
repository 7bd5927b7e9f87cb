#pragma once
// What a measurement that is not yet made would tell about which model is right. Pure functions.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/effect_probabilities.h"
#include "inference/diagnosis/model_evidence.h"

namespace calib::inference {

/// A measurement that might be made.
struct ProposedMeasurement {
  const DiagnosisSet* set = nullptr;  ///< of its tests, not null
  /// Where the same tests were measured before, what was read then (q): errors of the emulator, of
  /// staging and a discrepancy are the same ones again, specimen and noise are not. Empty: a new
  /// test.
  Eigen::VectorXd measured{};
  int specimens = 1;  ///< that `measured` is the mean of, >= 1
  /// Effects that the set's emulator has; models with others do not take part.
  PartOfColumns columns{};
};

/// How ExpectedInformation goes about it.
struct ForecastOptions {
  int measurements = 200;  ///< simulated, >= 10
  int draws = 100;         ///< of each model's posterior, >= 2
  double leading = 0.01;   ///< probability of a model that takes part
  int most_models = 12;
  double alone = 0.95;  ///< inclusion at which an effect is named
  std::uint64_t seed = 0;
};

/// What it would tell, on average over what it may read.
struct Forecast {
  double information = 0;  ///< nats about the model indicator, >= 0 but for chance
  double error = 0;        ///< standard error of that
  /// Chance that the true model has effects, all of them are at `alone` or above, and no other is.
  double named_right = 0;
  /// Chance of that, or where the true model has no effect that it is at `alone` or above itself.
  double decided = 0;
  double named_wrong = 0;  ///< chance that an effect that the true model has not is
};

/// Mutual information of the measurement and the model indicator, by nested sampling: a model by
/// its probability, a draw of its posterior, a measurement there; then the posterior of all leading
/// models, each averaged over its draws (so that parameters of rivals are fitted again by weight),
/// none of these among them.      [Chaloner & Verdinelli, Stat. Sci. 10 (1995) 273; Ryan 2003, Eq. 7]
/// Deterministic in the seed. Errors: INVALID_ARGUMENT for what does not fit.
absl::StatusOr<Forecast> ExpectedInformation(const ProposedMeasurement& proposed,
                                             const std::vector<ModelEvidence>& evidence,
                                             const EffectProbabilities& probabilities,
                                             const ForecastOptions& options = {});

}  // namespace calib::inference
