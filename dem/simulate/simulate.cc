#include "dem/simulate/simulate.h"

#include <optional>
#include <utility>

#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/lab_tests/shared/run_checkpoint.h"
#include "dem/lab_tests/shared/test_run.h"
#include "dem/registry/registry.h"
#include "dem/registry/scenario_problems.h"
#include "dem/simulate/vtk_series.h"

namespace calib::dem {
namespace {

/// Precondition: ScenarioProblems(scenario) is empty.
absl::StatusOr<Summary> Walk(const Scenario& scenario, RunRecord& record, std::stop_token stop) {
  const TestEntry& test = *FindTestEntry(scenario.test);
  const ModelEntries entries = EntriesOf(scenario.model);
  return test.procedure({scenario, entries, test.info, record, std::move(stop)});
}

}  // namespace

std::string CheckpointProblem(const Scenario& scenario, const std::string& checkpoint) {
  return std::string(UnpackCheckpoint(scenario, checkpoint).status().message());
}

absl::StatusOr<Summary> Simulate(const Scenario& scenario, const StateSink& sink,
                                 std::stop_token stop, const Recording& recording) {
  if (const auto problems = ScenarioProblems(scenario); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  std::optional<VtkSeries> series;
  if (!recording.vtk_directory.empty()) {
    series.emplace(recording.vtk_directory);
  }
  const auto is_drawn = [&](const State& state) {
    return series && state.load_step == recording.vtk_load_step.value_or(state.load_step);
  };
  const LoadStepSink reached = [&](const State& state, const Assembly* assembly) {
    sink(state);
    return is_drawn(state) && assembly != nullptr ? series->Add(*assembly, state.load_step)
                                                  : absl::OkStatus();
  };
  const bool goes_on =
      FindTestEntry(scenario.test)->info.needs_packing;  // single bodies start anew
  RunRecord record = recording.checkpoint && goes_on
                         ? RunRecord(reached, scenario, recording.checkpoint)
                         : RunRecord(reached);
  if (goes_on && !recording.resume_from.empty()) {
    ASSIGN_OR_RETURN(RunCheckpoint checkpoint, UnpackCheckpoint(scenario, recording.resume_from));
    for (const State& state : checkpoint.states) {
      sink(state);
      if (is_drawn(state)) {
        series->AddExisting(state.load_step);
      }
    }
    record.ResumeFrom(std::move(checkpoint));
  }
  return Walk(scenario, record, std::move(stop));
}

absl::StatusOr<Summary> SimulateGrains(const Scenario& scenario, const GrainSink& sink,
                                       std::stop_token stop) {
  if (const auto problems = ScenarioProblems(scenario); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  RunRecord record([&sink](const State& state, const Assembly* assembly) {
    return assembly == nullptr ? absl::OkStatus() : sink(state, *assembly);
  });
  return Walk(scenario, record, std::move(stop));
}

}  // namespace calib::dem
