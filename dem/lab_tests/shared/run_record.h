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

/// Stands between the procedure of a test and whoever wants its states and checkpoints. Not
/// thread-safe.
class RunRecord {
 public:
  /// A record without checkpoints. sink: takes states.
  explicit RunRecord(LoadStepSink sink) : sink_(std::move(sink)) {}

  /// A record whose checkpoints go to checkpoint_sink. sink: takes states.
  RunRecord(LoadStepSink sink, const Scenario& scenario, CheckpointSink checkpoint_sink)
      : sink_(std::move(sink)),
        checkpoint_sink_(std::move(checkpoint_sink)),
        head_(CheckpointHead(scenario)) {}

  /// Lets the run begin behind what a checkpoint of it holds.
  void ResumeFrom(RunCheckpoint checkpoint) { so_far_ = std::move(checkpoint); }

  /// Whether the run goes on from a checkpoint.
  [[nodiscard]] bool resumed() const { return so_far_.next > 0; }
  /// Index of the point of the path at which to begin.
  [[nodiscard]] std::size_t next_point() const { return so_far_.next; }
  /// The bytes that the procedure gave to WriteCheckpoint() last before the interruption; empty:
  /// the run is not resumed.
  [[nodiscard]] const std::string& procedure_state() const { return so_far_.procedure; }

  /// Tells the sink that a load step has been reached; assembly: null where the test has none.
  /// Errors: those of the sink.
  absl::Status ReportLoadStep(const State& state, const Assembly* assembly) {
    if (wants_checkpoints()) {
      so_far_.states.push_back(state);
    }
    return sink_(state, assembly);
  }

  /// Whether WriteCheckpoint() may be called.
  [[nodiscard]] bool wants_checkpoints() const { return static_cast<bool>(checkpoint_sink_); }

  /// Writes a checkpoint from which the run can go on at point `next` of the path, where the
  /// procedure gets `procedure` back. Precondition: wants_checkpoints(). Errors: those of the
  /// checkpoint sink.
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
