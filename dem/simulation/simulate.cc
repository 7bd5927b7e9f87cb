// Simulate() and SimulateWithVtk(): the two entrances to the engine.
#include <utility>

#include "absl/strings/str_join.h"
#include "dem/catalog/catalog.h"
#include "dem/simulation/collision_run.h"
#include "dem/simulation/element_test_run.h"
#include "dem/simulation/gravity_run.h"
#include "dem/simulation/scenario.h"
#include "dem/simulation/vtk_writer.h"

namespace calib::dem {
namespace {

absl::StatusOr<Summary> Run(const Scenario& scenario, const LoadStepSink& sink,
                            std::stop_token stop) {
  if (const auto problems = ScenarioProblems(scenario); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  if (FindTest(scenario.test)->poured) {
    return RunGravityTest(scenario, sink, std::move(stop));
  }
  return RunElementTest(scenario, sink, std::move(stop));
}

}  // namespace

absl::StatusOr<Summary> Simulate(const Scenario& scenario, const StateSink& sink,
                                 std::stop_token stop) {
  if (scenario.test == "collision") {
    if (const auto problems = ScenarioProblems(scenario); !problems.empty()) {
      return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
    }
    return RunCollision(scenario, sink, std::move(stop));
  }
  return Run(
      scenario,
      [&](const State& state, const Assembly&) {
        sink(state);
        return absl::OkStatus();
      },
      std::move(stop));
}

absl::StatusOr<Summary> SimulateWithVtk(const Scenario& scenario, const StateSink& sink,
                                        std::stop_token stop, const VtkOutput& vtk) {
  if (scenario.test == "collision") {
    return absl::InvalidArgumentError("collision: one contact has no pictures of grains");
  }
  return Run(
      scenario,
      [&](const State& state, const Assembly& assembly) {
        sink(state);
        return WriteVtk(assembly, vtk.directory, state.load_step);
      },
      std::move(stop));
}

}  // namespace calib::dem
