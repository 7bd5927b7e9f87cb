// Simulate(): the entrance to the engine.
#include <optional>
#include <utility>

#include "absl/strings/str_join.h"
#include "dem/catalog/catalog.h"
#include "dem/simulation/collision_run.h"
#include "dem/simulation/element_test_run.h"
#include "dem/simulation/gravity_run.h"
#include "dem/simulation/run_checkpoint.h"
#include "dem/simulation/run_record.h"
#include "dem/simulation/scenario.h"
#include "dem/simulation/vtk_series.h"

namespace calib::dem {

std::string CheckpointProblem(const Scenario& scenario, const std::string& checkpoint) {
  return std::string(UnpackCheckpoint(scenario, checkpoint).status().message());
}

absl::StatusOr<Summary> Simulate(const Scenario& scenario, const StateSink& sink,
                                 std::stop_token stop, const Recording& recording) {
  if (const auto problems = ScenarioProblems(scenario); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  if (scenario.test == "collision") {
    return RunCollision(scenario, sink, std::move(stop));
  }
  std::optional<VtkSeries> series;
  if (!recording.vtk_directory.empty()) {
    series.emplace(recording.vtk_directory);
  }
  const LoadStepSink reached = [&](const State& state, const Assembly& assembly) {
    sink(state);
    return series ? series->Add(assembly, state.load_step) : absl::OkStatus();
  };
  RunRecord record = recording.checkpoint ? RunRecord(reached, scenario, recording.checkpoint)
                                          : RunRecord(reached);
  if (!recording.resume_from.empty()) {
    auto checkpoint = UnpackCheckpoint(scenario, recording.resume_from);
    if (!checkpoint.ok()) {
      return checkpoint.status();
    }
    for (const State& state : checkpoint->states) {
      sink(state);
      if (series) {
        series->Recall(state.load_step);
      }
    }
    record.GoOnFrom(*std::move(checkpoint));
  }
  return FindTest(scenario.test)->poured ? RunGravityTest(scenario, record, std::move(stop))
                                         : RunElementTest(scenario, record, std::move(stop));
}

}  // namespace calib::dem
