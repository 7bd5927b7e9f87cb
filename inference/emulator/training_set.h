#pragma once
// Which runs the emulator learns from.

#include <Eigen/Core>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/emulator/state_emulator.h"

namespace calib::inference {

/// How many runs an emulator learns from. Chosen: campaigns of 60 to 100 runs, two to five
/// parameters, have 0.87 of their nine-tenths intervals right (measured by EmulatorCoverage of
/// inference_emulator_verification_test).
struct TrainingOptions {
  /// [20, 2000]: most runs to learn from; the cost of a prediction grows with the square.
  int max_runs = 120;
  int relevant_runs = 0;  ///< runs that matter, the best by likelihood, >= 0; 0: max(40, 10 d)
  /// [0, 1]: of the other runs, kept in a local training set to tie the far field down.
  double share_of_rest = 0.25;
  double scatter_share = 1;  ///< EmulatedLikelihood::Options::scatter_share
  PrincipalOptions principal = {};
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// N runs as an emulator sees them; diverged ones are left out.
struct Runs {
  Eigen::MatrixXd inputs;     ///< N x d, standardised parameters
  Eigen::MatrixXd histories;  ///< N x T, (prediction - reading) / sd
};

/// An emulator, and what it learned from.
struct TrainedEmulator {
  StateEmulator emulator;
  int runs = 0;                        ///< that it learned from
  std::vector<Eigen::Index> relevant;  ///< rows of Runs on which it was judged
  bool local = false;  ///< the local training set validated better than the broad one
};

/// Trains an emulator twice and keeps what predicts the relevant runs better. First broadly: all
/// runs, or the better half of max_runs and an even choice of the rest. Its predictions, not the
/// runs' own outcomes, then rank all runs by likelihood (a run whose scatter happens to lie towards
/// the measurement must not be preferred for that: the emulator would inherit the luck). Then
/// locally: the relevant runs and a share of the others. Judged by the leave-one-out log density of
/// the relevant runs with the readings' noise added. Deterministic. Errors: FAILED_PRECONDITION
/// with fewer than max(10, d + 4) runs, or when nothing can be factorised.
absl::StatusOr<TrainedEmulator> TrainEmulator(const Runs& runs, const DataSet& data,
                                              const TrainingOptions& options);

}  // namespace calib::inference
