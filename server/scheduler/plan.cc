#include "server/scheduler/plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "absl/strings/str_cat.h"
#include "server/scheduler/answer.h"
#include "server/scheduler/attempt_spec.h"
#include "server/scheduler/early_stopping.h"
#include "server/scheduler/history.h"
#include "server/scheduler/posterior_record.h"

namespace calib::scheduler {
namespace {

using campaign::Role;
using store::EvaluationStatus;

// Held-out experiments are run for the samples that carry the posterior: so many at most, and no
// more of the weighted ones than hold this share.
constexpr std::size_t kHeldOutRuns = 20;
constexpr double kValidatedMass = 0.99;

class Planner {
 public:
  Planner(const Definition& definition, const store::CampaignRecord& record, store::Reader& reader)
      : definition_(definition), campaign_(definition.campaign), record_(record), reader_(reader) {}

  absl::StatusOr<Plan> Next() {
    absl::StatusOr<History> history = LoadHistory(definition_, record_.submitted.id, reader_);
    if (!history.ok()) {
      return history.status();
    }
    history_ = *std::move(history);
    plan_.phase = record_.progress.phase;
    plan_.converged = record_.progress.converged;
    absl::Status status;
    if (history_.iterations.empty()) {
      status = Begin(0, campaign::FirstProposalOf(campaign_));
      if (campaign_.precomputed.has_value()) {
        plan_.event = CampaignEvent::kStart;
      }
    } else if (campaign_.table.has_value()) {
      Finish();  // its runs are all there is
    } else if (plan_.phase == "calibrating") {
      status = Conclude();
    } else {
      Finish();
    }
    if (!status.ok()) {
      return status;
    }
    return std::move(plan_);
  }

 private:
  void Finish() {
    plan_.phase = "done";
    plan_.event = CampaignEvent::kFinish;
  }

  absl::Status Fail(const absl::Status& why) {
    plan_ = Plan{};
    plan_.phase = record_.progress.phase;
    plan_.event = CampaignEvent::kFail;
    plan_.reason = std::string(why.message());
    return absl::OkStatus();
  }

  /// Posterior of the iteration that has just ended, then whatever follows from it.
  absl::Status Conclude() {
    const auto loss = StatedLoss(definition_, history_);
    if (!loss.ok()) {
      return Fail(loss.status());
    }
    if (!loss->resume.empty()) {
      plan_.resumed = loss->resume;
      plan_.log.push_back(absl::StrCat(loss->resume.size(),
                                       " evaluations stopped early are resumed: with the weights "
                                       "as they are now they could matter"));
      return absl::OkStatus();
    }
    stated_loss_ = loss->stated;
    const auto answer = FindAnswer(definition_, history_.iterations);
    if (!answer.ok()) {
      return Fail(answer.status());
    }
    const int iteration = static_cast<int>(history_.iterations.size()) - 1;
    absl::StatusOr<bool> converged = IsConverged(*answer);
    if (!converged.ok()) {
      return converged.status();
    }
    plan_.converged = *converged;
    AddConclusion(*answer, iteration);
    const bool last = *converged || campaign_.method == campaign::Method::kSqmc ||
                      campaign_.precomputed.has_value() ||
                      iteration + 1 >= campaign_.max_iterations || BudgetSpent();
    if (last) {
      return Validate(*answer);
    }
    const auto proposal = inference::FitProposal(definition_.priors, definition_.data,
                                                 campaign_.filter, history_.iterations);
    if (!proposal.ok()) {
      return Fail(proposal.status());
    }
    return Begin(iteration + 1, *proposal);
  }

  absl::StatusOr<bool> IsConverged(const Answer& answer) {
    if (!answer.HasIntervals()) {
      return false;
    }
    if (campaign_.method == campaign::Method::kSqmc || campaign_.precomputed.has_value()) {
      return true;  // one iteration is all there is
    }
    if (!history_.last_posterior.has_value()) {
      return false;
    }
    const auto before = PosteriorFromJson(*history_.last_posterior);
    if (!before.ok()) {
      return before.status();
    }
    if (before->posterior_from() == "none") {
      return false;
    }
    inference::Posterior now;
    now.parameters = answer.Parameters();
    return inference::MeansConverged(MeansOf(*before), now, campaign_.filter);
  }

  void AddConclusion(const Answer& answer, int iteration) {
    const inference::Posterior& posterior = answer.weighted;
    Conclusion conclusion{
        .iteration = iteration,
        .posterior = ToMessage(definition_, answer, iteration, plan_.converged),
        .log_weights = {posterior.log_weights.begin(), posterior.log_weights.end()},
        .log_likelihoods = LogLikelihoods()};
    conclusion.posterior.set_campaign(absl::StrCat("c", record_.submitted.id));
    conclusion.posterior.set_model_evaluations(history_.effort.model_evaluations);
    conclusion.posterior.set_stopped_early(history_.stopped_early);
    conclusion.posterior.set_stated_loss(stated_loss_);
    const auto view =
        inference::ViewOnline(definition_.data, campaign_.filter,
                              history_.iterations.back().predictions, history_.diverged.back());
    conclusion.posterior.set_best_misfit(view.best_rms);
    plan_.log.push_back(absl::StrCat("iteration ", iteration, " complete: ", posterior.ess,
                                     " effective samples, posterior from ",
                                     conclusion.posterior.posterior_from(), ", log evidence ",
                                     conclusion.posterior.log_evidence()));
    plan_.conclusion = std::move(conclusion);
  }

  std::vector<double> LogLikelihoods() {
    std::vector<double> values;
    for (const inference::Iteration& iteration : history_.iterations) {
      const auto of_iteration =
          inference::LogLikelihood(definition_.data, campaign_.filter, iteration.predictions);
      for (Eigen::Index i = 0; i < iteration.predictions.rows(); ++i) {
        values.push_back(of_iteration.ok() ? (*of_iteration)(i) : store::kUnknown);
      }
    }
    return values;
  }

  /// True when the next iteration would exceed what the user allowed.
  bool BudgetSpent() {
    const campaign::Budget& budget = campaign_.budget;
    const auto next = static_cast<std::int64_t>(campaign_.samples) *
                      static_cast<std::int64_t>(definition_.ExperimentsOf(Role::kCalibrate).size());
    const bool spent =
        (budget.model_evaluations.has_value() &&
         history_.effort.model_evaluations + next > *budget.model_evaluations) ||
        (budget.core_hours.has_value() && history_.effort.core_seconds > *budget.core_hours * 3600);
    if (spent) {
      plan_.log.emplace_back("no further iteration: it would exceed the budget");
    }
    return spent;
  }

  absl::Status Begin(int iteration, const inference::Proposal& proposal) {
    Start start{.iteration = iteration, .proposal = ProposalToJson(proposal), .samples = {}};
    Eigen::MatrixXd parameters;
    if (campaign_.precomputed.has_value()) {
      parameters = campaign_.precomputed->parameters;
    } else if (campaign_.table.has_value()) {
      parameters = campaign_.table->parameters;
    } else {
      auto drawn = inference::DrawSamples(proposal, definition_.priors, campaign_.filter, iteration,
                                          campaign_.samples);
      if (!drawn.ok()) {
        return Fail(drawn.status());
      }
      parameters = *std::move(drawn);
    }
    const auto thresholds = StopThresholds(
        definition_, history_,
        {.proposal = proposal, .parameters = parameters, .predictions = {}, .log_proposal = {}});
    if (!thresholds.ok()) {
      return Fail(thresholds.status());
    }
    const int first = iteration * record_.submitted.samples;
    for (Eigen::Index i = 0; i < parameters.rows(); ++i) {
      const Eigen::VectorXd row = parameters.row(i);
      start.samples.push_back({.sample = first + static_cast<int>(i),
                               .iteration = iteration,
                               .parameters = {row.begin(), row.end()},
                               .stop_below = (*thresholds)[static_cast<std::size_t>(i)]});
    }
    for (const store::SampleRecord& sample : start.samples) {
      if (absl::Status status = campaign_.precomputed.has_value()
                                    ? TakeFromTables(sample)
                                    : Ask(sample, definition_.ExperimentsOf(Role::kCalibrate));
          !status.ok()) {
        return status;
      }
    }
    plan_.start = std::move(start);
    return absl::OkStatus();
  }

  /// Adds evaluations of these experiments, reusing what was run before.
  absl::Status Ask(const store::SampleRecord& sample, const std::vector<int>& experiments) {
    for (const int experiment : experiments) {
      store::EvaluationRecord evaluation{
          .key = {record_.submitted.id, sample.sample, experiment},
          .digest = SpecDigest(SpecOf(campaign_, experiment, sample.parameters, sample.sample))};
      const auto equal = reader_.FindEqual(evaluation.digest);
      if (!equal.ok()) {
        return equal.status();
      }
      if (equal->has_value()) {
        plan_.reused.emplace_back(**equal, evaluation.key);
      }
      plan_.evaluations.push_back(std::move(evaluation));
    }
    return absl::OkStatus();
  }

  absl::Status TakeFromTables(const store::SampleRecord& sample) {
    for (std::size_t e = 0; e < campaign_.experiments.size(); ++e) {
      const std::size_t width = campaign_.experiments[e].observables.size();
      const auto& values =
          campaign_.precomputed->values[e][static_cast<std::size_t>(sample.sample)];
      const bool finite =
          std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
      const store::EvaluationKey key{record_.submitted.id, sample.sample, static_cast<int>(e)};
      plan_.evaluations.push_back(
          {.key = key,
           .status = finite ? EvaluationStatus::kFinished : EvaluationStatus::kDiverged,
           .reason = finite ? "" : "the table holds a value that is not finite",
           .reused = true});
      for (std::size_t r = 0; finite && (r + 1) * width <= values.size(); ++r) {
        const auto at = values.begin() + static_cast<std::ptrdiff_t>(r * width);
        plan_.states.push_back({.key = key,
                                .load_step = static_cast<int>(r),
                                .observables = {at, at + static_cast<std::ptrdiff_t>(width)}});
      }
    }
    return absl::OkStatus();
  }

  /// Held-out experiments for the samples that carry the posterior.
  absl::Status Validate(const Answer& answer) {
    const auto experiments = definition_.ExperimentsOf(Role::kValidate);
    if (experiments.empty() || campaign_.precomputed.has_value()) {
      Finish();
      return absl::OkStatus();
    }
    plan_.phase = "validating";
    return answer.FromEmulator() ? ValidateDraws(answer.emulated->draws, experiments)
                                 : ValidateSamples(experiments);
  }

  /// Draws evenly spaced in the population, as samples of an iteration of their own.
  absl::Status ValidateDraws(const Eigen::MatrixXd& draws, const std::vector<int>& experiments) {
    Start start{.iteration = static_cast<int>(history_.iterations.size()),
                .proposal = kHeldOutDraws,
                .samples = {}};
    const auto count = static_cast<Eigen::Index>(
        std::min({kHeldOutRuns, static_cast<std::size_t>(campaign_.samples),
                  static_cast<std::size_t>(draws.rows())}));
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::VectorXd row = draws.row(i * draws.rows() / count);
      start.samples.push_back(
          {.sample = start.iteration * record_.submitted.samples + static_cast<int>(i),
           .iteration = start.iteration,
           .parameters = {row.begin(), row.end()},
           .log_weight = -std::numeric_limits<double>::infinity()});  // not of the ensemble
      if (absl::Status status = Ask(start.samples.back(), experiments); !status.ok()) {
        return status;
      }
    }
    plan_.draws = std::move(start);
    return absl::OkStatus();
  }

  /// The samples with the largest weights (ties: the earlier sample).
  absl::Status ValidateSamples(const std::vector<int>& experiments) {
    const std::vector<double>& log_weights = plan_.conclusion->log_weights;
    std::vector<std::size_t> order(log_weights.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return log_weights[a] > log_weights[b]; });
    double mass = 0;
    for (std::size_t i = 0;
         i < std::min(order.size(), kHeldOutRuns) && mass < kValidatedMass; ++i) {
      mass += std::exp(log_weights[order[i]]);
      if (absl::Status status = Ask(history_.samples[order[i]], experiments); !status.ok()) {
        return status;
      }
    }
    return absl::OkStatus();
  }

  const Definition& definition_;
  const campaign::Campaign& campaign_;
  const store::CampaignRecord& record_;
  store::Reader& reader_;
  History history_;
  double stated_loss_ = 0;
  Plan plan_;
};

}  // namespace

absl::StatusOr<Plan> PlanNext(const Definition& definition, const store::CampaignRecord& campaign,
                              store::Reader& reader) {
  return Planner(definition, campaign, reader).Next();
}

void Write(const Plan& plan, std::int64_t campaign, const store::CampaignProgress& progress,
           std::int64_t unix_ms, store::Transaction& transaction) {
  if (plan.conclusion.has_value()) {
    const Conclusion& conclusion = *plan.conclusion;
    transaction.SetPosterior(campaign, conclusion.iteration, PosteriorToJson(conclusion.posterior));
    for (std::size_t i = 0; i < conclusion.log_weights.size(); ++i) {
      transaction.SetWeight(campaign, static_cast<int>(i), conclusion.log_weights[i],
                            conclusion.log_likelihoods[i]);
    }
  }
  for (const std::optional<Start>& start : {plan.start, plan.draws}) {
    if (start.has_value()) {
      transaction.InsertIteration(campaign, start->iteration, start->proposal);
      for (const store::SampleRecord& sample : start->samples) {
        transaction.InsertSample(campaign, sample);
      }
    }
  }
  for (const store::EvaluationRecord& evaluation : plan.evaluations) {
    transaction.InsertEvaluation(evaluation);
  }
  for (const auto& [from, to] : plan.reused) {
    transaction.ReuseEvaluation(from, to);
  }
  for (const store::EvaluationKey& key : plan.resumed) {
    transaction.NeverStop(campaign, key.sample);
    transaction.SetEvaluation(key, EvaluationStatus::kWaiting, "", 0);
  }
  for (const store::StateRecord& state : plan.states) {
    transaction.PutState(state, unix_ms);
  }
  transaction.SetProgress(campaign, progress);
  for (const std::string& line : plan.log) {
    transaction.Log(campaign, unix_ms, line);
  }
}

}  // namespace calib::scheduler
