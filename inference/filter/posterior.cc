// The posterior and its path from all finished iterations.

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "inference/evidence/importance_evidence.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/log_weights.h"
#include "inference/filter/parameter_summary.h"
#include "inference/filter/sequential_filter.h"
#include "inference/filter/weighted_moments.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastEss = 50;
constexpr double kLargestParetoIndex = 0.7;

PosteriorPath MakePath(const DataSet& data, const Ensemble& ensemble) {
  const StepOffsets steps = LoadSteps(data);
  const SequentialResult along =
      SequentialFilter(ensemble.log_start, ensemble.increments, steps, ensemble.parameters);
  PosteriorPath path;
  path.mean = along.mean;
  path.cov = along.cov;
  path.ess = along.ess;
  path.log_evidence.resize(steps.steps());
  // Before any reading the evidence is the mass of the prior as the samples see it, one up to
  // sampling error.
  double log_evidence =
      LogSumExp(ensemble.log_start) - std::log(static_cast<double>(ensemble.log_start.size()));
  for (int s = 0; s < steps.steps(); ++s) {
    path.experiment.push_back(data.readings[steps.offsets[s]].experiment);
    path.load_step.push_back(data.readings[steps.offsets[s]].load_step);
    log_evidence += along.log_evidence_increments[s];
    path.log_evidence[s] = log_evidence;
  }
  return path;
}

std::vector<std::string> Warnings(const FilterOptions& options, const Ensemble& ensemble,
                                  const Posterior& posterior) {
  std::vector<std::string> warnings;
  const auto total = static_cast<double>(ensemble.log_start.size());
  if (ensemble.diverged > 0) {
    warnings.push_back(
        absl::StrCat(ensemble.diverged, " of ", total, " samples diverged and have weight zero."));
  }
  if (ensemble.outside > 0) {
    warnings.push_back(absl::StrCat(ensemble.outside, " of ", total,
                                    " samples lie outside the prior and have weight zero."));
  }
  if (options.noise == NoiseMode::kEssTarget) {
    warnings.push_back(absl::StrCat("The noise level sigma = ", *posterior.sigma,
                                    " was chosen so that ", ensemble.tempering.ess, " of ", total,
                                    " samples count; it tempers the data and is no estimate of "
                                    "their error, and neither are the standard "
                                    "deviations that follow from it."));
    if (!ensemble.tempering.reached) {
      warnings.push_back(absl::StrCat("No noise level gives the wanted effective sample size of ",
                                      options.ess_target * total,
                                      ": the proposal differs too much from the prior. The level "
                                      "with the most effective samples was taken; "
                                      "more samples or a larger defensive share would help."));
    }
  }
  return warnings;
}

// Empty where the weights are enough.
std::string Degeneracy(const FilterOptions& options, const Ensemble& ensemble,
                       const Posterior& posterior) {
  const bool heavy = posterior.pareto_k > kLargestParetoIndex;
  if (options.noise == NoiseMode::kEssTarget || (posterior.ess >= kLeastEss && !heavy)) return "";
  return absl::StrCat("The weighted samples alone do not make a posterior: ",
                      std::floor(posterior.ess * 10) / 10, " of ", ensemble.log_start.size(),
                      " are effective and the Pareto index of their weights is ",
                      std::round(posterior.pareto_k * 100) / 100, " (wanted: at least ", kLeastEss,
                      " and at most ", kLargestParetoIndex, ").");
}

}  // namespace

absl::StatusOr<Posterior> ComputePosterior(std::span<const Prior> priors, const DataSet& data,
                                           const FilterOptions& options,
                                           std::span<const Iteration> iterations) {
  const auto ensemble = MakeEnsemble(priors, data, options, iterations);
  if (!ensemble.ok()) return ensemble.status();
  const Eigen::VectorXd unnormalized = ensemble->log_start + ensemble->log_likelihood;
  const Eigen::VectorXd log_weights = NormalizedLogWeights(unnormalized);

  Posterior posterior;
  posterior.log_weights =
      Eigen::VectorXd::Constant(ensemble->first + log_weights.size(), -kInfinity);
  posterior.log_weights.tail(log_weights.size()) = log_weights;
  const Eigen::VectorXd mean = WeightedMean(log_weights, ensemble->parameters);
  const Eigen::MatrixXd covariance = WeightedCovariance(log_weights, ensemble->parameters, mean);
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    posterior.parameters.push_back(
        Summarize(priors[j], log_weights, ensemble->parameters.col(j)));
  }
  posterior.correlation = CorrelationOf(covariance);
  const EvidenceEstimate evidence = ImportanceEvidence(unnormalized);
  posterior.log_evidence = evidence.log_evidence;
  posterior.log_evidence_se = evidence.standard_error;
  posterior.ess = EffectiveSampleSize(log_weights);
  posterior.pareto_k = ParetoTailIndex(log_weights);
  posterior.sigma = ensemble->sigma;
  posterior.path = MakePath(data, *ensemble);
  posterior.warnings = Warnings(options, *ensemble, posterior);
  posterior.degeneracy = Degeneracy(options, *ensemble, posterior);
  return posterior;
}

}  // namespace calib::inference
