#pragma once
// Runs that were stopped early, for an emulator to learn from what they came to.

#include <Eigen/Core>
#include <cstdint>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/emulator/state_emulator.h"
#include "inference/emulator/training_set.h"

namespace calib::inference {

/// How CompletedRuns completes.
struct CompletionOptions {
  double max_unknown =
      3;  ///< > 0: largest rms sd of what a run lacks [noise sd]; beyond it stays out
  std::uint64_t seed = 0;
};

/// The finished runs and, after them, the stopped ones whose missing readings can be told: each a
/// draw from what an emulator of runs expects at its parameters, given the readings that it came
/// to,
///   scores ~ N(m, D C D), D^2 = sd^2 + scatter_sd^2;  readings = mean + basis scores + remainder.
/// Whether a run is stopped follows from the readings it came to, so that what would have come
/// after, given these, is as in any other run [Rubin 1976, missing at random]. Without them the
/// emulator learns from runs whose scatter has kept them near the measurement, and takes the model
/// to be nearer than it is. A draw rather than its mean, so that the scatter keeps its size.
/// Deterministic in seed.
/// in: stopped: NaN where a run has no reading; a row of nothing but NaN stays out
Runs CompletedRuns(const Runs& finished, const Runs& stopped, const StateEmulator& emulator,
                   const CompletionOptions& options);

/// TrainEmulator on the finished runs, then twice on CompletedRuns: what is first expected of
/// stopped runs is what finished ones do. Without stopped runs TrainEmulator alone. Errors: of
/// TrainEmulator on the finished runs.
absl::StatusOr<TrainedEmulator> TrainWithStopped(const Runs& finished, const Runs& stopped,
                                                 const DataSet& data,
                                                 const TrainingOptions& training,
                                                 const CompletionOptions& completion);

}  // namespace calib::inference
