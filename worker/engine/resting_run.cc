#include "worker/engine/resting_run.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

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
  const auto keep = [&](const HeldRun& run) {
    if (checkpoints == nullptr || run.checkpoint.empty()) return;
    if (const absl::Status kept = checkpoints->Save(resting.run, run); !kept.ok()) {
      spdlog::warn("checkpoint run={} not_kept=\"{}\"", resting.run, std::string(kept.message()));
    }
  };
  std::stop_source rest;
  const std::stop_callback stopped(stop, [&rest] { rest.request_stop(); });
  const std::stop_callback left(resting.leave, [&rest] { rest.request_stop(); });
  bool arrived = false;
  std::int64_t sent = 0;
  HeldRun so_far{.steps = held.has_value() ? held->steps : 0,
                 .contact_updates = held.has_value() ? held->contact_updates : 0,
                 .checkpoint = {}};
  auto kept_at = std::chrono::steady_clock::now();
  const dem::StateSink until_rung = [&](const dem::State& state) {
    if (arrived) return;  // of a checkpoint that lies behind the rung
    sink(state);
    ++sent;
    arrived = state.load_step == resting.rest_after;
    if (arrived && held.has_value()) rest.request_stop();  // it may lie there: no other follows
  };
  const dem::CheckpointSink at_load_step = [&](const std::string& bytes) {
    so_far.checkpoint = bytes;
    if (arrived) rest.request_stop();
    if (const auto now = std::chrono::steady_clock::now(); now - kept_at >= kBetweenCheckpoints) {
      keep(so_far);
      kept_at = now;
    }
    return absl::OkStatus();
  };
  v1::Finished finished =
      Evaluate(spec, specimens, until_rung, rest.get_token(),
               {.vtk_directory = {},
                .checkpoint = checkpoints == nullptr && !resting.rest_after.has_value()
                                  ? dem::CheckpointSink()
                                  : at_load_step,
                .resume_from = held.has_value() ? held->checkpoint : ""});
  finished.set_states(sent);
  // Both count from the beginning of the run.
  const std::int64_t steps = std::max(finished.steps(), so_far.steps);
  const std::int64_t updates = std::max(finished.contact_updates(), so_far.contact_updates);
  finished.set_steps(steps - so_far.steps);
  finished.set_contact_updates(updates - so_far.contact_updates);
  so_far.steps = steps;
  so_far.contact_updates = updates;
  // A test without checkpoints comes to its end.
  if (arrived && (finished.outcome() == v1::Finished::OUTCOME_STOPPED ||
                  finished.outcome() == v1::Finished::OUTCOME_COMPLETED)) {
    finished.set_outcome(v1::Finished::OUTCOME_RESTING);
    finished.clear_reason();
  }
  if (finished.outcome() == v1::Finished::OUTCOME_RESTING ||
      (finished.outcome() == v1::Finished::OUTCOME_STOPPED && resting.leave.stop_requested())) {
    keep(so_far);
  } else if (checkpoints != nullptr && finished.outcome() != v1::Finished::OUTCOME_STOPPED) {
    checkpoints->Remove(resting.run);
  }
  return finished;
}

}  // namespace calib::worker
