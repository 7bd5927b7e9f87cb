#include "server/scheduler/plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "server/campaign/checks/run_table_check.h"
#include "server/campaign/model/replicates.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/scheduler/answer.h"
#include "server/scheduler/decisions.h"
#include "server/scheduler/early_stopping.h"
#include "server/scheduler/history.h"
#include "server/scheduler/method.h"
#include "server/scheduler/posterior_record.h"
#include "server/scheduler/requests.h"
#include "server/scheduler/rungs.h"
#include "server/scheduler/scatter.h"
#include "server/scheduler/unmoved.h"

namespace calib::scheduler {
namespace {

using campaign::Role;

constexpr double kMostEvaluations = 1e15;

constexpr const char* kDecidedAtOnce =
    "Decisions were taken at once, by what had arrived (inference.decisions: immediate): not "
    "reproducible, the same campaign run again may choose other samples or stop others.";

class Planner {
 public:
  /// scatter: measured on replicates, and part of the definition's errors where it belongs there;
  /// stated: the definition without it.
  Planner(const Definition& definition, const Definition& stated,
          const store::CampaignRecord& record, store::Reader& reader, bool replicating,
          std::vector<ObservableScatter> scatter)
      : definition_(definition),
        stated_(stated),
        campaign_(definition.campaign),
        record_(record),
        reader_(reader),
        scatter_(std::move(scatter)),
        replicating_(replicating) {}

  absl::StatusOr<Plan> Next() {
    absl::StatusOr<History> history = LoadHistory(definition_, record_.submitted.id, reader_);
    if (!history.ok()) {
      return history.status();
    }
    history_ = *std::move(history);
    plan_.phase = record_.progress.phase;
    plan_.converged = record_.progress.converged;
    absl::Status status;
    const bool runs_rows_only = campaign::RunsRowsOnly(campaign_.method);
    // A design to which nothing has been added.
    const bool is_empty =
        history_.iterations.empty() && runs_rows_only && !campaign_.table.has_value();
    if (history_.iterations.empty() && !is_empty) {
      status = Begin(runs_rows_only ? TableBatch() : MakeMethod(definition_)->First());
      if (DecidesAtOnce(definition_)) {
        plan_.log.emplace_back(
            "decisions are immediate (inference.decisions): this campaign is not reproducible");
      }
      if (campaign_.precomputed.has_value()) {
        plan_.event = CampaignEvent::kStart;
      }
    } else if (plan_.phase == campaign::Phase::kCalibrating && DecidesWhileRunning(definition_) &&
               !replicating_ && !is_empty) {
      status = GoOn();
    } else if (history_.open > 0) {
      return std::move(plan_);  // nothing to say
    } else if (plan_.phase == campaign::Phase::kCalibrating && !runs_rows_only) {
      status = Conclude(!BudgetSpent() && !replicating_);
    } else {
      Finish();  // the runs are all there is
    }
    if (!status.ok()) {
      return status;
    }
    return std::move(plan_);
  }

 private:
  void Finish() {
    plan_.phase = campaign::Phase::kDone;
    plan_.event = CampaignEvent::kFinish;
  }

  absl::Status Fail(const absl::Status& why) {
    plan_ = Plan{};
    plan_.phase = record_.progress.phase;
    plan_.event = CampaignEvent::kFail;
    plan_.reason = std::string(why.message());
    return absl::OkStatus();
  }

  /// While runs are under way, or after the last one: points and thresholds that follow from what
  /// has ended, and the posterior of the first iteration that has ended and has none.
  absl::Status GoOn() {
    const std::unique_ptr<Method> method = MakeMethod(definition_);
    const bool at_rest = history_.open == 0;
    if (at_rest && campaign::IsFilter(campaign_.method)) {
      return Conclude(!BudgetSpent());
    }
    const auto more = method->More(history_, Affordable());
    auto thresholds = DecidesAtOnce(definition_) ? method->Thresholds(history_)
                                                 : std::vector<std::pair<int, double>>{};
    for (const absl::Status& status : {more.status(), thresholds.status()}) {
      if (!status.ok()) {  // told when nothing is under way any more
        return at_rest ? Fail(status) : absl::OkStatus();
      }
    }
    plan_.stop_below = *std::move(thresholds);
    const bool grows = more->parameters.rows() > 0;
    const auto next = static_cast<std::size_t>(history_.concluded);
    const bool is_last = next + 1 >= history_.iterations.size();
    if (at_rest && is_last && !grows) {
      return Conclude(false);
    }
    if (grows) {
      RETURN_IF_ERROR(Begin(*more));
    }
    const bool is_complete = !is_last || (grows && !more->continues);
    return is_complete && HasEnded(next) ? ConcludeEarlier() : absl::OkStatus();
  }

  bool HasEnded(std::size_t iteration) const {
    if (iteration >= history_.ended.size()) {
      return false;
    }
    const std::vector<char>& ended = history_.ended[iteration];
    return std::all_of(ended.begin(), ended.end(), [](char is) { return is != 0; });
  }

  /// Posterior of the first iteration that has none, as if nothing had followed it.
  absl::Status ConcludeEarlier() {
    ASSIGN_OR_RETURN(auto history, LoadHistory(definition_, record_.submitted.id, reader_,
                                               history_.concluded + 1));
    history_ = std::move(history);
    const auto outcome = MakeMethod(definition_)->Conclude(history_, true);
    if (!outcome.ok()) {
      return Fail(outcome.status());
    }
    AddConclusion(*outcome);
    return absl::OkStatus();
  }

  /// Posterior of the iteration that has just ended, then whatever follows from it.
  absl::Status Conclude(bool affordable) {
    if (campaign::IsFilter(campaign_.method)) {
      if (const auto scouts = Scouts(definition_, history_); !scouts.empty()) {
        for (const store::EvaluationKey& key : scouts) {
          plan_.resumed.push_back({.key = key, .rest_after = std::nullopt});
        }
        plan_.log.push_back(absl::StrCat(scouts.size(),
                                         " evaluations go on to their ends: those that fit best up "
                                         "to the rung"));
        return absl::OkStatus();
      }
      const auto loss = StatedLoss(definition_, history_);
      if (!loss.ok()) {
        return Fail(loss.status());
      }
      if (!loss->resume.empty()) {
        for (const store::EvaluationKey& key : loss->resume) {
          plan_.resumed.push_back({.key = key, .rest_after = NextRung(definition_, history_, key)});
        }
        plan_.log.push_back(absl::StrCat(loss->resume.size(),
                                         RestsAtRungs(definition_)
                                             ? " resting or stopped evaluations go on"
                                             : " evaluations stopped early are resumed",
                                         ": with the weights as they are now they could matter"));
        return absl::OkStatus();
      }
      stated_loss_ = loss->stated;
      if (const auto chosen = ToAudit(definition_, history_, *loss); !chosen.empty()) {
        for (const int sample : chosen) {
          plan_.audited.emplace_back(sample, loss->bounds.at(sample));
        }
        for (const store::EvaluationKey& key : history_.stopped_keys) {
          if (std::binary_search(chosen.begin(), chosen.end(), key.sample)) {
            plan_.resumed.push_back({.key = key, .rest_after = std::nullopt});
          }
        }
        plan_.log.push_back(
            absl::StrCat(chosen.size(),
                         " samples stopped early go on to their ends to see what stopping loses"));
        return absl::OkStatus();
      }
      const auto audit = AuditOf(stated_, history_);
      if (!audit.ok()) {
        return Fail(audit.status());
      }
      audit_ = *audit;
    }
    if (replicating_) {
      history_.last_posterior = history_.previous_posterior;  // the same iteration once more
    }
    auto outcome = MakeMethod(definition_)->Conclude(history_, affordable);
    if (!outcome.ok()) {
      return Fail(outcome.status());
    }
    if (replicating_) {
      outcome->converged |= plan_.converged && outcome->answer.HasIntervals();
    }
    if (!scatter_.empty()) {
      outcome->answer.scatter = scatter_;
    } else if (TwinsShowNothing()) {
      plan_.log.emplace_back(
          "the twins show no scatter (they have not parted, or fewer than two came to their ends): "
          "none of it is among the errors");
    }
    plan_.converged = outcome->converged && UnknownIsSmall();
    AddConclusion(*outcome);
    if (replicating_) {
      return Validate(outcome->answer);
    }
    if (!outcome->next.has_value()) {
      const bool last = static_cast<int>(history_.iterations.size()) >= campaign_.max_iterations;
      if (!outcome->converged && !last && BudgetSpent()) {
        plan_.log.emplace_back("no further iteration: it would exceed the budget");
      }
      const int count = Replicates();
      return count > 0 ? Replicate(outcome->answer, count) : Validate(outcome->answer);
    }
    return Begin(*std::move(outcome->next));
  }

  void AddConclusion(const Outcome& outcome) {
    const inference::Posterior& posterior = outcome.answer.weighted;
    const int iteration = static_cast<int>(history_.iterations.size()) - 1;
    Conclusion conclusion{
        .iteration = iteration,
        .posterior = ToMessage(definition_, outcome.answer, iteration, plan_.converged),
        .samples = SampleNumbers(),
        .log_weights = {posterior.log_weights.begin(), posterior.log_weights.end()},
        .log_likelihoods = LogLikelihoods()};
    conclusion.posterior.set_campaign(absl::StrCat("c", record_.submitted.id));
    conclusion.posterior.set_model_evaluations(history_.effort.model_evaluations);
    conclusion.posterior.set_stopped_early(history_.stopped_early);
    if (DecidesAtOnce(definition_)) {
      conclusion.posterior.add_warnings(kDecidedAtOnce);
    }
    for (const campaign::Warning& warning : campaign::RunTableWarnings(campaign_)) {
      conclusion.posterior.add_warnings(campaign::Sentence(warning));
    }
    if (!campaign_.precomputed) {  // of tables of runs the sentences above say it
      for (const std::string& unmoved : UnmovedReadings(definition_, history_.iterations)) {
        conclusion.posterior.add_warnings(unmoved);
      }
    }
    if (const std::string unmoved = UnmovedParameters(definition_, outcome.answer);
        !unmoved.empty()) {
      conclusion.posterior.add_warnings(unmoved);
    }
    const bool judged = outcome.answer.HasIntervals() || !campaign::IsFilter(campaign_.method);
    if (const std::string left_out = campaign::ScatterLeftOut(campaign_);
        judged && !outcome.answer.FromEmulator() && !left_out.empty() && !TwinsShowNothing()) {
      conclusion.posterior.add_warnings(left_out);
    }
    conclusion.posterior.set_stated_loss(stated_loss_);
    TellUnknown(conclusion.posterior);
    if (audit_.samples > 0) {
      conclusion.posterior.set_audited(audit_.samples);
      conclusion.posterior.set_audited_bound(audit_.bound);
      conclusion.posterior.set_measured_loss(audit_.measured);
    }
    const auto view =
        inference::ViewOnline(definition_.data, campaign_.filter,
                              history_.iterations.back().predictions, history_.diverged.back());
    conclusion.posterior.set_best_misfit(view.best_rms);
    const double evidence = conclusion.posterior.log_evidence();
    plan_.log.push_back(absl::StrCat(
        "iteration ", iteration, " complete: ", outcome.log, outcome.log.empty() ? "" : ", ",
        posterior.ess, " effective samples, posterior from ", conclusion.posterior.posterior_from(),
        std::isfinite(evidence) ? absl::StrCat(", log evidence ", evidence) : ""));
    plan_.conclusion = std::move(conclusion);
  }

  /// Bound on the posterior mass that a campaign may leave out.
  double MayLeaveOut() const {
    return campaign_.early_stopping.value_or(campaign::EarlyStopping{}).discard_at_most;
  }

  /// Relative to the finished mass; NaN: nobody can tell.
  double UnknownMassNow() const {
    if (history_.unknown.empty()) return 0;
    if (!campaign::IsFilter(campaign_.method)) return store::kUnknown;
    const auto mass = UnknownMass(definition_, history_);
    return mass.ok() ? *mass : store::kUnknown;
  }

  bool UnknownIsSmall() const {
    return history_.unknown.empty() || UnknownMassNow() <= MayLeaveOut();
  }

  void TellUnknown(v1::Posterior& posterior) const {
    if (history_.unknown.empty()) return;
    const double mass = UnknownMassNow();
    posterior.set_unknown(static_cast<int>(history_.unknown.size()));
    posterior.set_unknown_mass(mass);
    const std::string held =
        std::isnan(mass)
            ? "what they could hold of the posterior is not known: not converged"
            : absl::StrCat("were they as likely as the best that finished, they would hold ", mass,
                           " of the posterior mass");
    const std::string verdict =
        std::isnan(mass) || mass <= MayLeaveOut()
            ? "."
            : absl::StrCat(", more than the ", MayLeaveOut(),
                           " that may be left out (early_stopping.discard_at_most): not converged. "
                           "`calibctl samples` says what their program printed last.");
    posterior.add_warnings(absl::StrCat(history_.unknown.size(), " of ", history_.samples.size(),
                                        " samples are unknown, for the program failed on them as "
                                        "often as it may, and are set aside; ",
                                        held, verdict));
  }

  bool TwinsShowNothing() const {
    return replicating_ && scatter_.empty() && !campaign::VariesPackings(campaign_);
  }

  std::vector<int> SampleNumbers() const {
    std::vector<int> numbers;
    for (const store::SampleRecord& sample : history_.samples) {
      numbers.push_back(sample.sample);
    }
    return numbers;
  }

  std::vector<double> LogLikelihoods() const {
    const bool tempered = campaign_.filter.noise == inference::NoiseMode::kEssTarget;
    const auto likelihood =
        tempered ? absl::FailedPreconditionError("known at the end alone")
                 : inference::GaussianLikelihood::Create(definition_.data, campaign_.filter.noise);
    std::vector<double> values;
    for (const inference::Iteration& iteration : history_.iterations) {
      const Eigen::Index n = iteration.predictions.rows();
      const Eigen::VectorXd of_iteration = likelihood.ok()
                                               ? likelihood->LogLikelihood(iteration.predictions)
                                               : Eigen::VectorXd::Constant(n, store::kUnknown);
      values.insert(values.end(), of_iteration.begin(), of_iteration.end());
    }
    return values;
  }

  /// How often the best estimate is to be run; 0: its scatter is not asked for or cannot be had.
  int Replicates() {
    const int wanted = campaign::ReplicatesOf(campaign_);
    if (wanted < 2) {
      return 0;
    }
    if (Exceeds(static_cast<std::int64_t>(wanted) *
                static_cast<std::int64_t>(campaign_.experiments.size()))) {
      plan_.log.emplace_back("scatter is not measured: it would exceed the budget");
      return 0;
    }
    if (std::string twins = campaign::TwinsInWords(campaign_); !twins.empty()) {
      plan_.log.push_back(std::move(twins));
    }
    return wanted;
  }

  /// The best estimate on every packing, or its twins on the only one, all experiments, as samples
  /// of an iteration of their own: consecutive numbers meet every packing once.
  absl::Status Replicate(const Answer& answer, int count) {
    Start start{.iteration = static_cast<int>(history_.iterations.size()),
                .proposal = kReplicates,
                .samples = {}};
    const std::vector<inference::ParameterSummary> parameters = answer.Parameters();
    Eigen::VectorXd best(static_cast<Eigen::Index>(parameters.size()));
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      best(static_cast<Eigen::Index>(j)) = parameters[j].mean;
    }
    const bool moved = !campaign::VariesPackings(campaign_);
    std::vector<int> experiments(campaign_.experiments.size());
    std::iota(experiments.begin(), experiments.end(), 0);
    for (int i = 0; i < count; ++i) {
      const Eigen::VectorXd own = moved ? Twin(best, i) : best;
      start.samples.push_back({.sample = start.iteration * record_.submitted.samples + i,
                               .iteration = start.iteration,
                               .parameters = {own.begin(), own.end()},
                               .log_weight = -std::numeric_limits<double>::infinity()});
      RETURN_IF_ERROR(requests_.Run(start.samples.back(), experiments));
    }
    plan_.draws = std::move(start);
    return absl::OkStatus();
  }

  /// As good as the same parameters, towards the middle of their priors.
  Eigen::VectorXd Twin(const Eigen::VectorXd& parameters, int number) const {
    Eigen::VectorXd moved = parameters;
    for (Eigen::Index j = 0; number > 0 && j < moved.size(); ++j) {
      const inference::Prior& prior = definition_.priors[static_cast<std::size_t>(j)];
      const double standard = prior.ToStandard(moved(j));
      moved(j) = prior.FromStandard(standard - std::copysign(kTwinShift * number, standard));
    }
    return moved;
  }

  /// True when the next iteration would exceed what the user allowed.
  bool BudgetSpent() const {
    const bool one_by_one = campaign_.method == campaign::Method::kSurrogateMsrs;
    return Exceeds((one_by_one ? 1 : campaign_.samples) * Calibrated());
  }

  /// How many samples more would not.
  std::int64_t Affordable() const {
    if (Exceeds(Calibrated())) {
      return 0;
    }
    std::int64_t evaluations = std::numeric_limits<std::int64_t>::max();
    if (campaign_.budget.model_evaluations.has_value()) {
      evaluations =
          *campaign_.budget.model_evaluations - history_.effort.model_evaluations - history_.open;
    }
    if (const double seconds = SecondsOfOne(); campaign_.budget.core_hours && seconds > 0) {
      const double left = *campaign_.budget.core_hours * 3600 - history_.effort.core_seconds;
      evaluations = std::min(
          evaluations,
          static_cast<std::int64_t>(std::min(left / seconds, kMostEvaluations)) - history_.open);
    }
    return evaluations / Calibrated();
  }

  /// Evaluations of one sample.
  std::int64_t Calibrated() const {
    return static_cast<std::int64_t>(definition_.ExperimentsOf(Role::kCalibrate).size());
  }

  /// Core seconds of one evaluation, those stopped early and repeated among them, in the mean over
  /// what has been asked for so far; 0 while nothing has.
  double SecondsOfOne() const {
    const std::int64_t asked =
        static_cast<std::int64_t>(history_.samples.size()) * Calibrated() - history_.open;
    return asked > 0 ? history_.effort.core_seconds / static_cast<double>(asked) : 0;
  }

  /// True when so many evaluations, beside those under way, would exceed it, core hours as those so
  /// far took them.
  bool Exceeds(std::int64_t next) const {
    const campaign::Budget& budget = campaign_.budget;
    return (budget.model_evaluations.has_value() &&
            history_.effort.model_evaluations + history_.open + next > *budget.model_evaluations) ||
           (budget.core_hours.has_value() &&
            history_.effort.core_seconds +
                    SecondsOfOne() * static_cast<double>(history_.open + next) >
                *budget.core_hours * 3600);
  }

  /// The rows that a table campaign runs.
  Batch TableBatch() const {
    const Eigen::MatrixXd& rows = campaign_.table->parameters;
    return {
        .proposal = ProposalToJson({}),
        .parameters = rows,
        .stop_below = std::vector<double>(static_cast<std::size_t>(rows.rows()), store::kUnknown),
        .refused = {}};
  }

  absl::Status Begin(const absl::StatusOr<Batch>& batch) {
    if (!batch.ok()) {
      return Fail(batch.status());
    }
    const auto iterations = static_cast<int>(history_.iterations.size());
    const int iteration = batch->continues ? iterations - 1 : iterations;
    const Eigen::Index there =
        batch->continues ? history_.iterations.back().parameters.rows() : Eigen::Index{0};
    Start start{.iteration = iteration,
                .proposal = batch->proposal,
                .samples = {},
                .continues = batch->continues};
    for (Eigen::Index i = 0; i < batch->parameters.rows(); ++i) {
      const Eigen::VectorXd row = batch->parameters.row(i);
      const auto position = static_cast<std::size_t>(i);
      start.samples.push_back(
          {.sample = iteration * record_.submitted.samples + static_cast<int>(there + i),
           .iteration = iteration,
           .parameters = {row.begin(), row.end()},
           .stop_below = batch->stop_below[position]});
      const bool refused = !batch->refused.empty() && batch->refused[position] != 0;
      if (iteration == 0 && i < GivenRuns(campaign_)) {
        RETURN_IF_ERROR(
            requests_.Run(start.samples.back(), definition_.ExperimentsOf(Role::kCalibrate)));
      } else {
        RETURN_IF_ERROR(requests_.Calibrate(start.samples.back(), refused));
      }
    }
    plan_.start = std::move(start);
    return absl::OkStatus();
  }

  /// Held-out experiments for the samples that carry the posterior.
  absl::Status Validate(const Answer& answer) {
    const auto experiments = definition_.ExperimentsOf(Role::kValidate);
    if (experiments.empty() || campaign_.precomputed.has_value()) {
      Finish();
      return absl::OkStatus();
    }
    plan_.phase = campaign::Phase::kValidating;
    if (answer.FromEmulator()) {
      return ValidateDraws(answer.emulated->draws, experiments);
    }
    const std::vector<double>& log_weights = plan_.conclusion->log_weights;
    for (const std::size_t i :
         answer.draws.rows() > 0 ? EvenlyByWeight(log_weights) : Heaviest(log_weights)) {
      RETURN_IF_ERROR(requests_.Run(history_.samples[i], experiments));
    }
    return absl::OkStatus();
  }

  /// Some of the draws, as samples of an iteration of their own.
  absl::Status ValidateDraws(const Eigen::MatrixXd& draws, const std::vector<int>& experiments) {
    Start start{.iteration = static_cast<int>(history_.iterations.size()) + (replicating_ ? 1 : 0),
                .proposal = kHeldOutDraws,
                .samples = {}};
    const Eigen::MatrixXd rows = EvenlySpaced(draws, static_cast<std::size_t>(campaign_.samples));
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Eigen::VectorXd row = rows.row(i);
      start.samples.push_back(
          {.sample = start.iteration * record_.submitted.samples + static_cast<int>(i),
           .iteration = start.iteration,
           .parameters = {row.begin(), row.end()},
           .log_weight = -std::numeric_limits<double>::infinity()});  // not of the ensemble
      RETURN_IF_ERROR(requests_.Run(start.samples.back(), experiments));
    }
    plan_.draws = std::move(start);
    return absl::OkStatus();
  }

  const Definition& definition_;
  const Definition& stated_;
  const campaign::Campaign& campaign_;
  const store::CampaignRecord& record_;
  store::Reader& reader_;
  const std::vector<ObservableScatter> scatter_;
  const bool replicating_;  // their runs have ended
  History history_;
  double stated_loss_ = 0;
  Audit audit_;
  Plan plan_;
  Requests requests_{definition_, record_.submitted.id, reader_, plan_};
};

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
    return Planner(definition, definition, campaign, reader, false, {}).Next();
  }
  ASSIGN_OR_RETURN(auto scatter, MeasureScatter(definition, campaign.submitted.id, reader));
  const Definition with = DefinitionWith(definition, scatter);
  return Planner(with, definition, campaign, reader, true, std::move(scatter.observables)).Next();
}

}  // namespace calib::scheduler
