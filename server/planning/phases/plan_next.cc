#include "server/planning/phases/plan_next.h"

#include <algorithm>

#include "calib/return_if_error.h"
#include "server/planning/decisions.h"
#include "server/planning/history.h"
#include "server/planning/phases/begin.h"
#include "server/planning/phases/budget.h"
#include "server/planning/phases/conclude.h"
#include "server/planning/phases/step.h"
#include "server/planning/planner.h"

namespace calib::planning {
namespace {

bool HasEnded(const History& history, std::size_t iteration) {
  if (iteration >= history.ended.size()) {
    return false;
  }
  const std::vector<char>& ended = history.ended[iteration];
  return std::all_of(ended.begin(), ended.end(), [](char is) { return is != 0; });
}

/// While runs are under way, or after the last one: points and thresholds that follow from what
/// has ended, and the posterior of the first iteration that has ended and has none.
absl::Status GoOn(Step& step) {
  const std::unique_ptr<Planner> planner = step.campaign().method->MakePlanner(step.definition);
  const bool at_rest = step.history.open == 0;
  if (at_rest && step.campaign().method->weighs_samples()) {
    return Conclude(step, !BudgetSpent(step));
  }
  const auto more = planner->More(step.history, Affordable(step));
  auto thresholds = DecidesAtOnce(step.definition) ? planner->Thresholds(step.history)
                                                   : std::vector<std::pair<int, double>>{};
  for (const absl::Status& status : {more.status(), thresholds.status()}) {
    if (!status.ok()) {  // told when nothing is under way any more
      return at_rest ? step.Fail(status) : absl::OkStatus();
    }
  }
  step.plan.stop_below = *std::move(thresholds);
  const bool grows = more->parameters.rows() > 0;
  const auto next = static_cast<std::size_t>(step.history.concluded);
  const bool is_last = next + 1 >= step.history.iterations.size();
  if (at_rest && is_last && !grows) {
    return Conclude(step, false);
  }
  if (grows) {
    RETURN_IF_ERROR(Begin(step, *more));
  }
  const bool is_complete = !is_last || (grows && !more->continues);
  return is_complete && HasEnded(step.history, next) ? ConcludeEarlier(step) : absl::OkStatus();
}

/// The first iteration: the method's, or the rows of the file.
absl::Status BeginAll(Step& step) {
  const campaign::Campaign& campaign = step.campaign();
  RETURN_IF_ERROR(Begin(step, campaign::RunsRowsOnly(campaign)
                                  ? RowsOfFile(campaign)
                                  : campaign.method->MakePlanner(step.definition)->First()));
  if (DecidesAtOnce(step.definition)) {
    step.plan.log.emplace_back(
        "decisions are immediate (inference.decisions): this campaign is not reproducible");
  }
  if (campaign.precomputed.has_value()) {
    step.plan.event = CampaignEvent::kStart;
  }
  return absl::OkStatus();
}

absl::StatusOr<Plan> Next(Step& step) {
  ASSIGN_OR_RETURN(auto history,
                   LoadHistory(step.definition, step.record.submitted.id, step.reader));
  step.history = std::move(history);
  step.plan.phase = step.record.progress.phase;
  step.plan.converged = step.record.progress.converged;
  const bool runs_rows_only = campaign::RunsRowsOnly(step.campaign());
  const bool calibrates = step.plan.phase == campaign::Phase::kCalibrating;
  // Runs are to be added, and none has been.
  const bool is_empty =
      step.history.iterations.empty() && runs_rows_only && !step.campaign().table.has_value();
  if (step.history.iterations.empty() && !is_empty) {
    RETURN_IF_ERROR(BeginAll(step));
  } else if (calibrates && DecidesWhileRunning(step.definition) && !step.replicating && !is_empty) {
    RETURN_IF_ERROR(GoOn(step));
  } else if (step.history.open > 0) {
    return std::move(step.plan);  // nothing to say
  } else if (calibrates && !runs_rows_only) {
    RETURN_IF_ERROR(Conclude(step, !BudgetSpent(step) && !step.replicating));
  } else {
    step.Finish();  // the runs are all there is
  }
  return std::move(step.plan);
}

}  // namespace

absl::StatusOr<Plan> PlanNext(const Definition& definition, const store::CampaignRecord& campaign,
                              store::Reader& reader) {
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign.submitted.id));
  // Replicates are the last runs of the calibration; what follows them is the end of its phase.
  const bool replicating =
      campaign.progress.phase == campaign::Phase::kCalibrating &&
      std::any_of(iterations.begin(), iterations.end(),
                  [](const store::IterationRecord& i) { return i.proposal == kReplicates; });
  if (!replicating) {
    Step step{definition, definition, campaign, reader};
    return Next(step);
  }
  ASSIGN_OR_RETURN(auto scatter, MeasureScatter(definition, campaign.submitted.id, reader));
  const Definition with = DefinitionWith(definition, scatter);
  Step step{with, definition, campaign, reader, true, std::move(scatter.observables)};
  return Next(step);
}

}  // namespace calib::planning
