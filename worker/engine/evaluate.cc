#include "worker/engine/evaluate.h"

#include "absl/strings/str_cat.h"
#include "dem/model/state.h"
#include "dem/simulate/simulate.h"
#include "worker/engine/scenario_from_spec.h"

namespace calib::worker {
namespace {

v1::Finished::Outcome ToMessage(dem::Outcome outcome) {
  switch (outcome) {
    case dem::Outcome::kCompleted:
      return v1::Finished::OUTCOME_COMPLETED;
    case dem::Outcome::kStopped:
      return v1::Finished::OUTCOME_STOPPED;
    case dem::Outcome::kDiverged:
      break;
  }
  return v1::Finished::OUTCOME_DIVERGED;
}

// Of a test that is walked in stages; empty: of any other.
std::string ToText(const dem::Staging& staging) {
  if (!staging.rate.has_value()) return "";
  return absl::StrCat(
      "rate=", staging.rate.value_or(0), " step=", staging.step.value_or(0),
      " damping=", staging.damping_loading.value_or(0), ",", staging.damping_settling.value_or(0),
      " unbalanced=", staging.unbalanced.value_or(0), staging.adaptive ? " adaptive" : "");
}

// A specimen that cannot be made as asked for is a result like a model that diverges: another
// attempt ends the same way.
v1::Finished Ended(const absl::Status& status) {
  v1::Finished finished;
  switch (status.code()) {
    case absl::StatusCode::kCancelled:
      finished.set_outcome(v1::Finished::OUTCOME_STOPPED);
      break;
    case absl::StatusCode::kOutOfRange:
      finished.set_outcome(v1::Finished::OUTCOME_DIVERGED);
      break;
    default:
      finished.set_outcome(v1::Finished::OUTCOME_FAILED);
  }
  finished.set_reason(std::string(status.message()));
  return finished;
}

}  // namespace

v1::Finished Evaluate(const v1::AttemptSpec& spec, Specimens& specimens, const dem::StateSink& sink,
                      std::stop_token stop, const dem::Recording& recording) {
  const auto specimen = specimens.Get(spec, stop);
  if (!specimen.ok()) return Ended(specimen.status());
  dem::Scenario scenario = ScenarioFromSpec(spec);
  scenario.packing = (*specimen)->packing;
  scenario.meshes = (*specimen)->meshes;
  std::int64_t states = 0;
  const dem::StateSink counted = [&](const dem::State& state) {
    ++states;
    sink(state);
  };
  const auto summary = dem::Simulate(scenario, counted, stop, recording);
  v1::Finished finished;
  if (summary.ok()) {
    finished.set_outcome(ToMessage(summary->outcome));
    finished.set_reason(summary->reason);
    finished.set_steps(summary->steps);
    finished.set_contact_updates(summary->contact_updates);
    finished.set_staging(ToText(summary->staging));
  } else {
    finished = Ended(summary.status());
  }
  finished.set_states(states);
  return finished;
}

}  // namespace calib::worker
