#include "server/planning/phases/conclude.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "server/campaign/checks/run_table_check.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/planning/decisions.h"
#include "server/planning/phases/audit.h"
#include "server/planning/phases/begin.h"
#include "server/planning/phases/budget.h"
#include "server/planning/phases/replicate.h"
#include "server/planning/phases/validate.h"
#include "server/planning/planner.h"
#include "server/planning/posterior_record.h"
#include "server/planning/unmoved.h"

namespace calib::planning {
namespace {

constexpr const char* kDecidedAtOnce =
    "Decisions were taken at once, by what had arrived (inference.decisions: immediate): not "
    "reproducible, the same campaign run again may choose other samples or stop others.";

std::vector<int> SampleNumbers(const History& history) {
  std::vector<int> numbers;
  for (const store::SampleRecord& sample : history.samples) {
    numbers.push_back(sample.sample);
  }
  return numbers;
}

std::vector<double> LogLikelihoods(const Step& step) {
  const inference::NoiseMode noise = step.campaign().filter.noise;
  const auto likelihood = noise == inference::NoiseMode::kEssTarget
                              ? absl::FailedPreconditionError("known at the end alone")
                              : inference::GaussianLikelihood::Create(step.definition.data, noise);
  std::vector<double> values;
  for (const inference::Iteration& iteration : step.history.iterations) {
    const Eigen::Index n = iteration.predictions.rows();
    const Eigen::VectorXd of_iteration = likelihood.ok()
                                             ? likelihood->LogLikelihood(iteration.predictions)
                                             : Eigen::VectorXd::Constant(n, store::kUnknown);
    values.insert(values.end(), of_iteration.begin(), of_iteration.end());
  }
  return values;
}

void AddWarnings(const Step& step, const Answer& answer, v1::Posterior& posterior) {
  const campaign::Campaign& campaign = step.campaign();
  if (DecidesAtOnce(step.definition)) {
    posterior.add_warnings(kDecidedAtOnce);
  }
  for (const campaign::Warning& warning : campaign::RunTableWarnings(campaign)) {
    posterior.add_warnings(campaign::Sentence(warning));
  }
  if (!campaign.precomputed) {  // of tables of runs the sentences above say it
    for (const std::string& unmoved : UnmovedReadings(step.definition, step.history.iterations)) {
      posterior.add_warnings(unmoved);
    }
  }
  if (const std::string unmoved = UnmovedParameters(step.definition, answer); !unmoved.empty()) {
    posterior.add_warnings(unmoved);
  }
  const bool judged = answer.HasIntervals() || !campaign.method->weighs_samples();
  if (const std::string left_out = campaign::ScatterLeftOut(campaign);
      judged && !answer.FromEmulator() && !left_out.empty() && !TwinsShowNothing(step)) {
    posterior.add_warnings(left_out);
  }
}

void AddConclusion(Step& step, const Outcome& outcome, const LeftOut& left_out) {
  const inference::Posterior& posterior = outcome.answer.weighted;
  const int iteration = step.iterations() - 1;
  Conclusion conclusion{
      .iteration = iteration,
      .posterior = ToMessage(step.definition, outcome.answer, iteration, step.plan.converged),
      .samples = SampleNumbers(step.history),
      .log_weights = {posterior.log_weights.begin(), posterior.log_weights.end()},
      .log_likelihoods = LogLikelihoods(step)};
  v1::Posterior& message = conclusion.posterior;
  message.set_campaign(absl::StrCat("c", step.record.submitted.id));
  message.set_model_evaluations(step.history.effort.model_evaluations);
  message.set_stopped_early(step.history.stopped_early);
  AddWarnings(step, outcome.answer, message);
  message.set_stated_loss(left_out.stated);
  TellUnknown(step, message);
  if (left_out.audit.samples > 0) {
    message.set_audited(left_out.audit.samples);
    message.set_audited_bound(left_out.audit.bound);
    message.set_measured_loss(left_out.audit.measured);
  }
  const auto view = inference::ViewOnline(step.definition.data, step.campaign().filter,
                                          step.history.iterations.back().predictions,
                                          step.history.diverged.back());
  message.set_best_misfit(view.best_rms);
  const double evidence = message.log_evidence();
  step.plan.log.push_back(absl::StrCat(
      "iteration ", iteration, " complete: ", outcome.log, outcome.log.empty() ? "" : ", ",
      posterior.ess, " effective samples, posterior from ", message.posterior_from(),
      std::isfinite(evidence) ? absl::StrCat(", log evidence ", evidence) : ""));
  step.plan.conclusion = std::move(conclusion);
}

}  // namespace

absl::Status ConcludeEarlier(Step& step) {
  ASSIGN_OR_RETURN(auto history, LoadHistory(step.definition, step.record.submitted.id, step.reader,
                                             step.history.concluded + 1));
  step.history = std::move(history);
  const auto outcome =
      step.campaign().method->MakePlanner(step.definition)->Conclude(step.history, true);
  if (!outcome.ok()) {
    return step.Fail(outcome.status());
  }
  AddConclusion(step, *outcome, {});
  return absl::OkStatus();
}

absl::Status Conclude(Step& step, bool affordable) {
  const campaign::Campaign& campaign = step.campaign();
  LeftOut left_out;
  if (campaign.method->weighs_samples()) {
    const auto looked = LookAtStopped(step);
    if (!looked.has_value()) {
      return absl::OkStatus();
    }
    left_out = *looked;
  }
  if (step.replicating) {
    step.history.last_posterior = step.history.previous_posterior;  // the same iteration once more
  }
  auto outcome = campaign.method->MakePlanner(step.definition)->Conclude(step.history, affordable);
  if (!outcome.ok()) {
    return step.Fail(outcome.status());
  }
  if (step.replicating) {
    outcome->converged |= step.plan.converged && outcome->answer.HasIntervals();
  }
  if (!step.scatter.empty()) {
    outcome->answer.scatter = step.scatter;
  } else if (TwinsShowNothing(step)) {
    step.plan.log.emplace_back(
        "the twins show no scatter (they have not parted, or fewer than two came to their ends): "
        "none of it is among the errors");
  }
  step.plan.converged = outcome->converged && UnknownIsSmall(step);
  AddConclusion(step, *outcome, left_out);
  if (step.replicating) {
    return Validate(step, outcome->answer);
  }
  if (outcome->next.has_value()) {
    return Begin(step, *std::move(outcome->next));
  }
  const bool last = step.iterations() >= campaign.max_iterations;
  if (!outcome->converged && !last && BudgetSpent(step)) {
    step.plan.log.emplace_back("no further iteration: it would exceed the budget");
  }
  const int count = ReplicatesWanted(step);
  return count > 0 ? Replicate(step, outcome->answer, count) : Validate(step, outcome->answer);
}

}  // namespace calib::planning
