#include "worker/engine/resting_run.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "dem/model/state.h"
#include "dem/simulate/simulate.h"
#include "worker/engine/evaluate.h"
#include "worker/engine/scenario_from_spec.h"

namespace calib::worker {
namespace {

/// The run as it is held, if this program can go on from it.
std::optional<HeldRun> FindUsable(const v1::AttemptSpec& spec, const std::string& run,
                                  const Checkpoints* checkpoints, Specimens& specimens,
                                  const std::stop_token& stop) {
  auto held = checkpoints == nullptr ? std::nullopt : checkpoints->Find(run);
  if (!held.has_value()) return std::nullopt;
  const auto specimen = specimens.Get(spec, stop);
  if (!specimen.ok()) return std::nullopt;  // Evaluate() says why
  dem::Scenario scenario = ScenarioFromSpec(spec);
  scenario.packing = (*specimen)->packing;
  scenario.meshes = (*specimen)->meshes;
  if (const auto problem = dem::CheckpointProblem(scenario, held->checkpoint); !problem.empty()) {
    spdlog::warn("checkpoint run={} refused=\"{}\"", run, problem);
    checkpoints->Remove(run);
    return std::nullopt;
  }
  return held;
}

}  // namespace

v1::Finished EvaluateToRung(const v1::AttemptSpec& spec, const RestingRun& resting,
                            const Checkpoints* checkpoints, Specimens& specimens,
                            const dem::StateSink& sink, std::stop_token stop) {
  const auto held = FindUsable(spec, resting.run, checkpoints, specimens, stop);
  std::stop_source rest;
  const std::stop_callback both(stop, [&rest] { rest.request_stop(); });
  bool arrived = false;
  std::int64_t sent = 0;
  std::string checkpoint;
  const dem::StateSink until_rung = [&](const dem::State& state) {
    if (arrived) return;  // of a checkpoint that lies behind the rung
    sink(state);
    ++sent;
    arrived = state.load_step == resting.rest_after;
    if (arrived && held.has_value()) rest.request_stop();  // it may lie there: no other follows
  };
  const dem::Recording recording{.vtk_directory = {},
                                 .checkpoint =
                                     [&](const std::string& bytes) {
                                       if (arrived) {
                                         checkpoint = bytes;
                                         rest.request_stop();
                                       }
                                       return absl::OkStatus();
                                     },
                                 .resume_from = held.has_value() ? held->checkpoint : ""};
  v1::Finished finished = Evaluate(spec, specimens, until_rung, rest.get_token(), recording);
  finished.set_states(sent);
  const HeldRun so_far{.steps = finished.steps(),
                       .contact_updates = finished.contact_updates(),
                       .checkpoint = std::move(checkpoint)};
  if (held.has_value() && so_far.steps >= held->steps) {  // none when it could not be resumed
    finished.set_steps(so_far.steps - held->steps);
    finished.set_contact_updates(so_far.contact_updates - held->contact_updates);
  }
  // A test without checkpoints comes to its end.
  if (arrived && (finished.outcome() == v1::Finished::OUTCOME_STOPPED ||
                  finished.outcome() == v1::Finished::OUTCOME_COMPLETED)) {
    finished.set_outcome(v1::Finished::OUTCOME_RESTING);
    finished.clear_reason();
  }
  if (checkpoints == nullptr) {
    return finished;
  }
  if (finished.outcome() == v1::Finished::OUTCOME_RESTING && !so_far.checkpoint.empty()) {
    if (const absl::Status kept = checkpoints->Save(resting.run, so_far); !kept.ok()) {
      spdlog::warn("checkpoint run={} not_kept=\"{}\"", resting.run, std::string(kept.message()));
    }
  } else if (finished.outcome() != v1::Finished::OUTCOME_RESTING &&
             finished.outcome() != v1::Finished::OUTCOME_STOPPED) {
    checkpoints->Remove(resting.run);
  }
  return finished;
}

}  // namespace calib::worker
