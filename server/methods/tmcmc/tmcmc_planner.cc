#include "server/methods/tmcmc/tmcmc_planner.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
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
#include "server/planning/early_stopping.h"
#include "server/planning/plan_memory.h"
#include "server/planning/posterior_record.h"
#include "server/planning/stage_misfit.h"

namespace calib::methods {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Quantiles of fewer different draws say nothing (the limit that the filter's weights have to
/// meet).
constexpr double kFewestDraws = 50;

struct ChainsSoFar final : planning::PlannerMemory {
  std::optional<inference::TmcmcState> chains;  // where they stand after `batches`
  std::size_t batches = 0;
};

class TmcmcPlanner final : public planning::Planner {
 public:
  TmcmcPlanner(const planning::Definition& definition, const inference::TmcmcOptions& options)
      : definition_(definition), options_(options) {
    options_.samples = definition.campaign.samples;
    options_.seed = definition.campaign.seed;
    options_.max_stages = std::numeric_limits<int>::max();  // the cap is looked at here
    options_.first = campaign::FirstProposalOf(definition.campaign);
  }

  absl::StatusOr<planning::Batch> First() const override {
    ASSIGN_OR_RETURN(const auto state, inference::StartTmcmc(definition_.priors, options_));
    planning::Batch batch = NextBatch(state);
    batch.proposal = planning::ProposalToJson(options_.first);
    return batch;
  }

  absl::StatusOr<planning::Outcome> Conclude(const planning::History& history,
                                             bool affordable) const override {
    ASSIGN_OR_RETURN(const auto state, Replay(history));
    planning::Outcome outcome{
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
  absl::StatusOr<inference::TmcmcState> Replay(const planning::History& history) const {
    auto& memory = definition_.memory->Of<ChainsSoFar>();
    const bool goes_on = memory.chains.has_value() && memory.batches <= history.iterations.size();
    const std::size_t first = goes_on ? memory.batches : 0;
    auto state = goes_on ? absl::StatusOr<inference::TmcmcState>(*memory.chains)
                         : inference::StartTmcmc(definition_.priors, options_);
    ASSIGN_OR_RETURN(const auto likelihoods,
                     planning::LogLikelihoodsByBatch(definition_, history, first));
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

  planning::Batch NextBatch(const inference::TmcmcState& state) const {
    planning::Batch batch{.proposal = planning::ProposalToJson(inference::Proposal{}),
                          .parameters = state.proposals,
                          .stop_below = {},
                          .refused = {}};
    const bool stops = planning::StopsEarly(definition_);
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
  static Eigen::MatrixXd PredictionsOf(const inference::TmcmcState& state,
                                       const planning::History& history) {
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
  void AddChecks(const inference::TmcmcState& state, const planning::History& history,
                 inference::Posterior& posterior) const {
    const Eigen::Index n = state.samples.rows();
    const Eigen::VectorXd equal = Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
    const std::vector<int> half_of_family = inference::Halves(n);
    std::vector<int> halves;
    for (const int ancestor : state.ancestor) {
      halves.push_back(half_of_family[static_cast<std::size_t>(ancestor)]);
    }
    posterior.split_half =
        inference::HalvesDiffer(state.samples, equal, halves, posterior.parameters);
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

  planning::Answer AnswerOf(const inference::TmcmcState& state,
                            const planning::History& history) const {
    planning::Answer answer;
    answer.weights_source = "tmcmc";
    inference::Posterior& posterior = answer.weighted;
    const Eigen::Index n = state.samples.rows();
    const Eigen::VectorXd equal = Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
    posterior.log_weights = LogWeights(state);
    for (std::size_t j = 0; j < definition_.priors.size(); ++j) {
      posterior.parameters.push_back(inference::Summarize(
          definition_.priors[j], equal, state.samples.col(static_cast<Eigen::Index>(j))));
    }
    answer.weighted_members = planning::SummarizeMembers(definition_.campaign, state.samples);
    const Eigen::VectorXd mean = inference::WeightedMean(equal, state.samples);
    posterior.correlation =
        inference::CorrelationOf(inference::WeightedCovariance(equal, state.samples, mean));
    posterior.log_evidence = state.finished() ? state.log_evidence : planning::kNone;
    posterior.log_evidence_se =
        state.finished() ? state.LogEvidenceStandardError() : planning::kNone;
    posterior.ess = inference::EffectiveSampleSize(posterior.log_weights);
    posterior.pareto_k = planning::kNone;
    posterior.degeneracy = Degeneracy(state, posterior.ess);
    if (posterior.degeneracy.empty()) {
      answer.draws = state.samples;
      answer.stage_p = planning::StageP(definition_, planning::StagesOf(definition_),
                                        PredictionsOf(state, history), equal);
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

  const planning::Definition& definition_;
  inference::TmcmcOptions options_;
};

}  // namespace

std::unique_ptr<planning::Planner> MakeTmcmcPlanner(const planning::Definition& definition,
                                                    const inference::TmcmcOptions& options) {
  return std::make_unique<TmcmcPlanner>(definition, options);
}

}  // namespace calib::methods
