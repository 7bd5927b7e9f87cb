// tmcmc: every Metropolis step of every stage is one batch, the proposals of all chains. Where the
// chains stand follows from the stored samples and states (computed again after a start, kept from
// plan to plan after that); whether a proposal is accepted was decided by a number drawn before it
// ran, so neither order nor restarts matter.

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/parameter_summary.h"
#include "inference/filter/posterior_checks.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/shuffle.h"
#include "inference/tmcmc/tmcmc.h"
#include "server/scheduler/early_stopping.h"
#include "server/scheduler/method.h"
#include "server/scheduler/plan_memory.h"
#include "server/scheduler/posterior_record.h"
#include "server/scheduler/stage_misfit.h"

namespace calib::scheduler {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Quantiles of fewer different draws say nothing (the limit that the filter's weights have to
/// meet).
constexpr double kFewestDraws = 50;

class TmcmcMethod final : public Method {
 public:
  explicit TmcmcMethod(const Definition& definition)
      : definition_(definition), options_(definition.campaign.tmcmc) {
    options_.samples = definition.campaign.samples;
    options_.seed = definition.campaign.seed;
    options_.max_stages = std::numeric_limits<int>::max();  // the cap is looked at here
    options_.first = campaign::FirstProposalOf(definition.campaign);
  }

  absl::StatusOr<Batch> First() const override {
    ASSIGN_OR_RETURN(const auto state, inference::StartTmcmc(definition_.priors, options_));
    Batch batch = NextBatch(state);
    batch.proposal = ProposalToJson(options_.first);
    return batch;
  }

  absl::StatusOr<Outcome> Conclude(const History& history, bool affordable) const override {
    ASSIGN_OR_RETURN(const auto state, Replay(history));
    Outcome outcome{
        .answer = AnswerOf(state, history), .converged = false, .log = Describe(state), .next = {}};
    outcome.converged = state.finished() && outcome.answer.HasIntervals();
    const auto stages = static_cast<int>(state.stages.size());
    if (!state.finished() && affordable && stages <= definition_.campaign.max_iterations) {
      outcome.next = NextBatch(state);
    }
    return outcome;
  }

 private:
  /// Goes on from where the plan before left the chains.
  absl::StatusOr<inference::TmcmcState> Replay(const History& history) const {
    PlanMemory& memory = *definition_.memory;
    const bool goes_on = memory.chains.has_value() && memory.batches <= history.iterations.size();
    const std::size_t first = goes_on ? memory.batches : 0;
    auto state = goes_on ? absl::StatusOr<inference::TmcmcState>(*memory.chains)
                         : inference::StartTmcmc(definition_.priors, options_);
    ASSIGN_OR_RETURN(const auto likelihoods, LogLikelihoodsByBatch(definition_, history, first));
    for (std::size_t k = first; state.ok() && k < history.iterations.size(); ++k) {
      if (state->proposals != history.iterations[k].parameters) {
        return absl::DataLossError(
            absl::StrCat("the stored samples of batch ", k,
                         " are not those that follow from the ones before; "
                         "was the campaign begun by another version of this program?"));
      }
      RETURN_IF_ERROR(
          inference::AdvanceTmcmc(definition_.priors, options_, likelihoods[k - first], *state));
    }
    if (state.ok()) {
      memory.chains = *state;
      memory.batches = history.iterations.size();
    }
    return state;
  }

  Batch NextBatch(const inference::TmcmcState& state) const {
    Batch batch{.proposal = ProposalToJson(inference::Proposal{}),
                .parameters = state.proposals,
                .stop_below = {},
                .refused = {}};
    const bool stops = StopsEarly(definition_);
    for (const double needed : state.accept_above) {
      batch.refused.push_back(needed == kInfinity ? 1 : 0);
      batch.stop_below.push_back(stops && std::isfinite(needed) ? needed : store::kUnknown);
    }
    return batch;
  }

  /// "stage 3, step 2 of 10, exponent 0.05"
  std::string Describe(const inference::TmcmcState& state) const {
    if (state.finished()) {
      return absl::StrCat("exponent 1 reached in ", state.stages.size(), " stages");
    }
    return absl::StrFormat(
        "stage %d, step %d of %d, exponent %.3g", state.stages.size(), state.step,
        inference::StepsPerStage(options_, definition_.priors.size()), state.exponent);
  }

  /// Each run weighs as many shares as chains stand on it.
  static Eigen::VectorXd LogWeights(const inference::TmcmcState& state) {
    Eigen::VectorXd counts = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(state.evaluated));
    for (const std::int64_t run : state.origin) {
      counts(static_cast<Eigen::Index>(run)) += 1;
    }
    return (counts / static_cast<double>(state.origin.size())).array().log();
  }

  /// Predictions of the runs that the chains stand on, one row per chain.
  static Eigen::MatrixXd PredictionsOf(const inference::TmcmcState& state, const History& history) {
    std::vector<Eigen::Index> begins;  // first run of each batch
    Eigen::Index runs = 0;
    for (const inference::Iteration& batch : history.iterations) {
      begins.push_back(runs);
      runs += batch.predictions.rows();
    }
    Eigen::MatrixXd predictions(state.samples.rows(),
                                history.iterations.front().predictions.cols());
    for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
      const auto run = static_cast<Eigen::Index>(state.origin[static_cast<std::size_t>(i)]);
      const auto batch = std::prev(std::upper_bound(begins.begin(), begins.end(), run));
      predictions.row(i) =
          history.iterations[static_cast<std::size_t>(batch - begins.begin())].predictions.row(
              run - *batch);
    }
    return predictions;
  }

  /// What the chains say of the fit, of the noise and of themselves. Chains of one family are not
  /// independent of each other: halves are of families, not of chains.
  void AddChecks(const inference::TmcmcState& state, const History& history,
                 inference::Posterior& posterior) const {
    const Eigen::Index n = state.samples.rows();
    const Eigen::VectorXd equal = Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
    const std::vector<int> half_of_family = inference::Halves(n);
    std::vector<int> halves;
    for (const int ancestor : state.ancestor) {
      halves.push_back(half_of_family[static_cast<std::size_t>(ancestor)]);
    }
    posterior.split_half = inference::SplitHalf(state.samples, equal, halves, posterior.parameters);
    if (definition_.campaign.filter.noise == inference::NoiseMode::kGiven) {
      posterior.predictive_p =
          inference::PredictiveP(definition_.data, state.log_likelihood, equal);
      return;
    }
    const auto likelihood =
        inference::GaussianLikelihood::Create(definition_.data, definition_.campaign.filter.noise);
    if (!likelihood.ok()) return;  // the chains have come this far by it
    const Eigen::MatrixXd predictions = PredictionsOf(state, history);
    if (definition_.campaign.filter.noise == inference::NoiseMode::kModelError) {
      posterior.model_errors =
          inference::ModelErrorsOver(*likelihood, definition_.data, predictions, equal);
    } else {
      posterior.noise_scale =
          inference::NoiseScale(likelihood->VarianceFactors(predictions), equal);
    }
  }

  Answer AnswerOf(const inference::TmcmcState& state, const History& history) const {
    Answer answer;
    answer.weights_source = "tmcmc";
    inference::Posterior& posterior = answer.weighted;
    const Eigen::Index n = state.samples.rows();
    const Eigen::VectorXd equal = Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
    posterior.log_weights = LogWeights(state);
    for (std::size_t j = 0; j < definition_.priors.size(); ++j) {
      posterior.parameters.push_back(inference::Summarize(
          definition_.priors[j], equal, state.samples.col(static_cast<Eigen::Index>(j))));
    }
    answer.weighted_members = SummarizeMembers(definition_.campaign, state.samples);
    const Eigen::VectorXd mean = inference::WeightedMean(equal, state.samples);
    posterior.correlation =
        inference::CorrelationOf(inference::WeightedCovariance(equal, state.samples, mean));
    posterior.log_evidence = state.finished() ? state.log_evidence : kNone;
    posterior.log_evidence_se = state.finished() ? state.LogEvidenceStandardError() : kNone;
    posterior.ess = inference::EffectiveSampleSize(posterior.log_weights);
    posterior.pareto_k = kNone;
    posterior.degeneracy = Degeneracy(state, posterior.ess);
    if (posterior.degeneracy.empty()) {
      answer.draws = state.samples;
      answer.stage_p =
          StageP(definition_, StagesOf(definition_), PredictionsOf(state, history), equal);
      AddChecks(state, history, posterior);
    } else {
      answer.warnings.push_back(posterior.degeneracy);
    }
    return answer;
  }

  std::string Degeneracy(const inference::TmcmcState& state, double different) const {
    if (!state.finished()) {
      return absl::StrCat(
          "The chains have not reached the posterior: they stand at ", Describe(state),
          " of 1, and the means are those of that tempered population. No standard "
          "deviations, quantiles or evidence are given; allow more model evaluations "
          "or a larger max_iterations (of stages).");
    }
    if (different < kFewestDraws) {
      return absl::StrFormat(
          "The %d chains stand on only %.0f effectively different samples, too "
          "few for standard deviations and quantiles: run more chains (samples) "
          "or more steps per stage.",
          state.samples.rows(), different);
    }
    return "";
  }

  const Definition& definition_;
  inference::TmcmcOptions options_;
};

}  // namespace

std::unique_ptr<Method> MakeTmcmcMethod(const Definition& definition) {
  return std::make_unique<TmcmcMethod>(definition);
}

}  // namespace calib::scheduler
