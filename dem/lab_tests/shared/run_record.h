#pragma once
// What is told and kept of a run while it goes from point to point of its path.

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "dem/dynamics/assembly.h"
#include "dem/lab_tests/shared/run_checkpoint.h"
#include "dem/model/state.h"

namespace calib::dem {

/// Called at each load step with its state and the grains that made it, null where a test has none.
/// An error ends the run with that error.
using LoadStepSink = std::function<absl::Status(const State& state, const Assembly* assembly)>;

/// Between the procedure of a test and whoever wants its states and checkpoints.
class RunRecord {
 public:
  /// Without checkpoints.
  explicit RunRecord(LoadStepSink sink) : sink_(std::move(sink)) {}

  /// With checkpoints for `keep` after each point.
  RunRecord(LoadStepSink sink, const Scenario& scenario, CheckpointSink keep)
      : sink_(std::move(sink)),
        checkpoint_sink_(std::move(keep)),
        head_(CheckpointHead(scenario)) {}

  /// The run begins behind what a checkpoint of it holds.
  void ResumeFrom(RunCheckpoint checkpoint) { so_far_ = std::move(checkpoint); }

  [[nodiscard]] bool resumed() const { return so_far_.next > 0; }
  /// Where on the path to begin.
  [[nodiscard]] std::size_t next_point() const { return so_far_.next; }
  /// What the procedure gave to Keep() when it was interrupted.
  [[nodiscard]] const std::string& procedure_state() const { return so_far_.procedure; }

  /// A load step has been reached. Errors: those of the sink.
  absl::Status ReportLoadStep(const State& state, const Assembly* assembly) {
    if (wants_checkpoints()) {
      so_far_.states.push_back(state);
    }
    return sink_(state, assembly);
  }

  [[nodiscard]] bool wants_checkpoints() const { return static_cast<bool>(checkpoint_sink_); }

  /// From here the run could go on at point `next` of the path with these bytes. Precondition:
  /// keeps(). Errors: those of the checkpoint sink.
  absl::Status WriteCheckpoint(std::size_t next, std::string procedure) {
    so_far_.next = next;
    so_far_.procedure = std::move(procedure);
    return checkpoint_sink_(PackCheckpoint(head_, so_far_));
  }

 private:
  LoadStepSink sink_;
  CheckpointSink checkpoint_sink_;
  std::string head_;
  RunCheckpoint so_far_;
};

}  // namespace calib::dem
