#pragma once
// What a run gives: states of load steps, how it ended, checkpoints.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "dem/model/scenario.h"

namespace calib::dem {

/// Observables at one load step, in the order of the test's TestInfo::observables; all finite.
struct State {
  int load_step = 0;
  std::vector<double> values;
};

/// How a run ended.
enum class Outcome {
  kCompleted,  ///< every point of the path was reached
  kStopped,    ///< the stop token was set
  kDiverged,   ///< NaN, lost grains, or a stage that never settled; Summary::reason says which,
               ///< where and when
};

/// What a run tells of itself at its end.
struct Summary {
  Outcome outcome = Outcome::kCompleted;
  std::string reason;                ///< empty when completed
  std::int64_t steps = 0;            ///< time steps made
  std::int64_t contact_updates = 0;  ///< sum over steps of active contacts
  double time_step = 0;              ///< last time step [s]
  Staging staging;                   ///< as used, every field set
};

/// Takes the state of each load step as soon as it is reached, from the thread that runs.
using StateSink = std::function<void(const State&)>;

/// Takes the bytes from which a run can go on after a point of its path; they replace those that
/// the sink was given before. An error ends the run with that error.
using CheckpointSink = std::function<absl::Status(const std::string& checkpoint)>;

}  // namespace calib::dem
