#include "server/planning/answer.h"

#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "inference/emulator/search_widening.h"
#include "inference/emulator/split_half.h"
#include "inference/filter/parameter_summary.h"
#include "inference/filter/widened_posterior.h"
#include "server/planning/stage_misfit.h"

namespace calib::planning {
namespace {

/// Of a factor on intervals.
constexpr double kWorthSaying = 1.1;

/// Carried along the readings: means to about 0.07 sd.
constexpr int kPathDraws = 400;

constexpr const char* kNothingGiven =
    "No standard deviations, quantiles or held-out judgement are given. ";

inference::EmulatorOptions EmulatorOptionsOf(const Definition& definition) {
  const inference::FilterOptions& filter = definition.campaign.filter;
  inference::EmulatorOptions options{.noise = filter.noise, .training = {}, .seed = filter.seed};
  options.training.scatter_share =
      definition.mean_data ? 0 : LargestScatterShare(definition.campaign);
  return options;
}

const inference::DataSet& EmulatedData(const Definition& definition) {
  return definition.mean_data ? *definition.mean_data : definition.data;
}

void ExplainEmulator(const Answer& answer, std::vector<std::string>& warnings) {
  const inference::EmulatedResult& emulated = *answer.emulated;
  if (emulated.adequate) {
    warnings.push_back(absl::StrFormat(
        "%s The posterior was therefore sampled on an emulator of %d runs, which predicts a run "
        "left out to %.2f standard deviations of the readings' noise (%.2f of them scatter of "
        "single runs); this error is part of the intervals.",
        answer.weighted.degeneracy, emulated.runs, emulated.cross_validated_error,
        emulated.scatter));
  } else {
    warnings.push_back(
        absl::StrCat(answer.weighted.degeneracy, " ", kNothingGiven,
                     "Not even an emulator of the runs gives a posterior: ", emulated.reason));
  }
}

std::vector<inference::ParameterSummary> MeansAlone(
    std::vector<inference::ParameterSummary> means) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (inference::ParameterSummary& mean : means) {
    mean.sd = mean.cov = mean.q05 = mean.q50 = mean.q95 = kNone;
  }
  return means;
}

std::vector<inference::ParameterSummary> MembersOfWeights(
    const campaign::Campaign& campaign, std::span<const inference::Iteration> iterations,
    const Eigen::VectorXd& log_weights) {
  if (campaign.populations.empty()) return {};
  Eigen::MatrixXd samples(log_weights.size(),
                          static_cast<Eigen::Index>(campaign.parameters.size()));
  Eigen::Index row = 0;
  for (const inference::Iteration& iteration : iterations) {
    samples.middleRows(row, iteration.parameters.rows()) = iteration.parameters;
    row += iteration.parameters.rows();
  }
  return SummarizeMembers(campaign, samples, log_weights);
}

// About the means, which stay.
void Widen(double factor, std::vector<inference::ParameterSummary>& members) {
  for (inference::ParameterSummary& one : members) {
    for (double* quantile : {&one.q05, &one.q50, &one.q95})
      *quantile = one.mean + factor * (*quantile - one.mean);
    one.sd *= factor;
    one.cov *= factor;
  }
}

}  // namespace

std::vector<inference::ParameterSummary> SummarizeMembers(const campaign::Campaign& campaign,
                                                          const Eigen::MatrixXd& draws,
                                                          const Eigen::VectorXd& log_weights) {
  std::vector<inference::ParameterSummary> members;
  // The value of a label has no prior of its own that it could be at a bound of.
  const inference::Prior unbounded{.kind = inference::PriorKind::kNormal};
  for (const campaign::Population& population : campaign.populations) {
    const auto common = draws.col(static_cast<Eigen::Index>(population.common));
    const auto spread = draws.col(static_cast<Eigen::Index>(population.spread));
    for (const std::size_t score : population.scores) {
      const Eigen::VectorXd values =
          common.array() + spread.array() * draws.col(static_cast<Eigen::Index>(score)).array();
      members.push_back(inference::Summarize(unbounded, log_weights, values));
    }
  }
  return members;
}

std::vector<inference::ParameterSummary> SummarizeMembers(const campaign::Campaign& campaign,
                                                          const Eigen::MatrixXd& draws) {
  const auto n = static_cast<double>(draws.rows());
  return SummarizeMembers(campaign, draws, Eigen::VectorXd::Constant(draws.rows(), -std::log(n)));
}

std::vector<inference::ParameterSummary> Answer::Parameters() const {
  if (FromEmulator()) {
    return emulated->parameters;
  }
  if (FromWeights()) {
    return weighted.parameters;
  }
  return MeansAlone(weighted.parameters);
}

std::vector<inference::ParameterSummary> Answer::Members(const campaign::Campaign& campaign) const {
  if (FromEmulator()) return SummarizeMembers(campaign, emulated->draws);
  return FromWeights() ? weighted_members : MeansAlone(weighted_members);
}

void AskEmulator(const Definition& definition, std::span<const inference::Iteration> iterations,
                 Answer& answer) {
  inference::EmulatorOptions options = EmulatorOptionsOf(definition);
  options.replicates = definition.replicates;
  options.known = definition.known;
  for (Stage& stage : StagesOf(definition)) options.stages.push_back(std::move(stage.judged));
  options.path_draws = kPathDraws;
  options.reversed_path = definition.campaign.filter.reversed_path;
  const inference::DataSet& data = EmulatedData(definition);
  auto emulated = inference::EmulatedPosterior(definition.priors, data, options, iterations);
  if (emulated.ok()) {
    if (emulated->adequate) {
      answer.stage_p = emulated->stage_p;
      answer.scatter = ScatterOfEmulator(definition, *emulated);
      const inference::SplitHalf split =
          inference::SplitHalfOfEmulator(definition.priors, data, options, iterations, *emulated);
      emulated->split_half = split.difference;
      if (std::isfinite(split.log_evidence_error)) {
        emulated->log_evidence_se = std::hypot(emulated->log_evidence_se, split.log_evidence_error);
      } else {
        answer.warnings.emplace_back(
            "Half of the runs give no emulated posterior: the error of the log evidence is that of "
            "the sampling alone, what the emulator does not know comes on top.");
      }
    }
    answer.emulated = *std::move(emulated);
    ExplainEmulator(answer, answer.warnings);
  } else {
    answer.warnings.push_back(absl::StrCat(
        answer.weighted.degeneracy, " ", kNothingGiven,
        "An emulator of the runs is not possible: ", std::string(emulated.status().message())));
  }
}

SearchDraws DrawsToGoOnFrom(const Definition& definition,
                            std::span<const inference::Iteration> iterations,
                            const Answer& answer) {
  const inference::DataSet& data = EmulatedData(definition);
  const double widening = definition.campaign.filter.noise == inference::NoiseMode::kGiven
                              ? inference::SearchWidening(data, iterations)
                              : 1;
  if (widening > 1) {
    auto wider =
        inference::EmulatedPosterior(definition.priors, inference::WithLargerErrors(data, widening),
                                     EmulatorOptionsOf(definition), iterations);
    if (wider.ok() && wider->draws.rows() > 0) {
      Eigen::MatrixXd closest = inference::ClosestDraws(*wider);
      return {.draws = std::move(wider->draws), .closest = std::move(closest)};
    }
  }
  return {.draws = answer.emulated.has_value() ? answer.emulated->draws : Eigen::MatrixXd(),
          .closest = {}};
}

namespace {

// One sentence on what the posterior is given.
std::string ConditionedOn(const Definition& definition,
                          const std::vector<std::optional<double>>& frozen) {
  std::string held;
  for (std::size_t j = 0; j < frozen.size(); ++j) {
    if (!frozen[j].has_value()) {
      continue;
    }
    const campaign::CalibratedParameter& parameter = definition.campaign.parameters[j];
    absl::StrAppend(&held, held.empty() ? "" : " and ", parameter.name, " = ", *frozen[j],
                    parameter.unit == "1" ? "" : " ", parameter.unit == "1" ? "" : parameter.unit);
  }
  return held.empty() ? ""
                      : absl::StrCat("Conditioned on ", held,
                                     ": held since it had converged or by request, not inferred; "
                                     "what is said of the others and the log evidence hold given "
                                     "this, and leave its uncertainty out.");
}

// Whether tables hold runs with and without an effect of the model, in whatever numbers.
bool AreNoDraws(const campaign::Campaign& campaign) {
  return campaign.precomputed && !campaign.model.effects.empty() &&
         !campaign.precomputed->log_proposal;
}

// How well the runs that the weights rest on fit each stage: of a large table only these are
// copied.
std::vector<double> StagePOfWeights(const Definition& definition,
                                    std::span<const inference::Iteration> iterations,
                                    const Eigen::VectorXd& log_weights) {
  constexpr double kNoWeight = 1e-12;  // as in inference::PredictiveP
  const std::vector<Stage> stages = StagesOf(definition);
  if (stages.empty()) return {};
  const Eigen::Index runs = (log_weights.array() >= std::log(kNoWeight)).count();
  Eigen::MatrixXd predictions(runs, iterations.front().predictions.cols());
  Eigen::VectorXd weights(runs);
  Eigen::Index run = 0;
  Eigen::Index kept = 0;
  for (const inference::Iteration& iteration : iterations) {
    for (Eigen::Index i = 0; i < iteration.predictions.rows(); ++i, ++run) {
      if (!(log_weights[run] >= std::log(kNoWeight))) continue;
      predictions.row(kept) = iteration.predictions.row(i);
      weights[kept++] = log_weights[run];
    }
  }
  return StageP(definition, stages, predictions, weights);
}

}  // namespace

absl::StatusOr<Answer> FindAnswer(const Definition& definition,
                                  std::span<const inference::Iteration> iterations) {
  ASSIGN_OR_RETURN(auto weighted, inference::ComputePosterior(definition.priors, definition.data,
                                                              definition.campaign.filter,
                                                              iterations, definition.known));
  Answer answer;
  answer.weighted = std::move(weighted);
  answer.weighted_members =
      MembersOfWeights(definition.campaign, iterations, answer.weighted.log_weights);
  answer.warnings = answer.weighted.warnings;
  if (std::string held = ConditionedOn(definition, answer.weighted.frozen); !held.empty()) {
    answer.warnings.insert(answer.warnings.begin(), std::move(held));
  }
  if (answer.FromWeights() && AreNoDraws(definition.campaign)) {
    answer.weighted.degeneracy =
        "Runs with and without what acts are a design and no draws of the prior: their weights "
        "make no posterior.";
  }
  if (!answer.FromWeights()) {
    AskEmulator(definition, iterations, answer);
    return answer;
  }
  answer.stage_p = StagePOfWeights(definition, iterations, answer.weighted.log_weights);
  if (definition.replicates && definition.campaign.filter.noise == inference::NoiseMode::kGiven) {
    const double widened =
        inference::WidenByRefits(definition.priors, definition.data, *definition.replicates,
                                 iterations, definition.campaign.filter.seed, answer.weighted);
    Widen(widened, answer.weighted_members);  // by the largest factor of a parameter
    if (widened > kWorthSaying) {
      answer.warnings.push_back(absl::StrFormat(
          "Fits to one packing or another differ by more than the errors say: the intervals are "
          "widened, by a factor of %.1f at most.",
          widened));
    }
  }
  return answer;
}

}  // namespace calib::planning
