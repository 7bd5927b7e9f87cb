#pragma once
// The entrance to the engine: one run of a scenario.

#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"

namespace calib::dem {

/// How a run is recorded; nothing here changes its states.
struct Recording {
  std::string vtk_directory{};  ///< for a series of grains, contacts and walls after each load step
                                ///< (simulate/vtk_series.h); empty: none. `collision` writes none.
  std::optional<int> vtk_load_step{};  ///< the only load step of that series; empty: all
  CheckpointSink checkpoint{};  ///< called after each point of the path, when its state has been
                                ///< given to the sink; empty: no checkpoints. `collision` has none.
  std::string resume_from{};    ///< a checkpoint of this scenario: its states are given to the sink
                                ///< again, and the run goes on from there; empty: from the start
};

/// Why a run of this scenario cannot go on from a checkpoint, in a sentence; empty: it can.
std::string CheckpointProblem(const Scenario& scenario, const std::string& checkpoint);

/// Runs the scenario, calling sink once per load step as soon as it is reached, from the calling
/// thread. The stop token is looked at every time step. A diverged run is a result (Outcome), not
/// an error. Errors: INVALID_ARGUMENT (joined ScenarioProblems, CheckpointProblem), OUT_OF_RANGE
/// (unreachable consolidation porosity), UNAVAILABLE naming a VTK file that cannot be written, and
/// those of the checkpoint sink. Same scenario, same bits, for any number of threads and however
/// often it was interrupted. Thread-safe (no shared state).
absl::StatusOr<Summary> Simulate(const Scenario& scenario, const StateSink& sink,
                                 std::stop_token stop, const Recording& recording = {});

class Assembly;  // dynamics/assembly.h

/// Takes the state of a load step and the grains that made it. An error ends the run with that
/// error.
using GrainSink = std::function<absl::Status(const State& state, const Assembly& assembly)>;

/// Simulate() with the grains of every load step, without checkpoints. `collision`, which has no
/// grains, gives nothing to the sink. Thread-safe.
absl::StatusOr<Summary> SimulateGrains(const Scenario& scenario, const GrainSink& sink,
                                       std::stop_token stop);

}  // namespace calib::dem
