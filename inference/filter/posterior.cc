// The posterior and its path from all finished iterations.

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "inference/evidence/importance_evidence.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/log_weights.h"
#include "inference/filter/sequential_filter.h"
#include "inference/filter/weighted_moments.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastEss = 50;
constexpr double kLargestParetoIndex = 0.7;
constexpr double kOuterShare = 0.02;  // of the prior's probability at one end
constexpr double kBoundShare = 0.1;   // of the posterior's

double MassWhere(const Eigen::VectorXd& log_weights, const Eigen::VectorXd& values, double low,
                 double high) {
  double mass = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] >= low && values[i] <= high) mass += std::exp(log_weights[i]);
  }
  return mass;
}

ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values, double mean, double variance) {
  ParameterSummary summary;
  summary.mean = mean;
  summary.sd = std::sqrt(variance);
  summary.cov = summary.sd / std::abs(mean);
  summary.q05 = WeightedQuantile(log_weights, values, 0.05);
  summary.q50 = WeightedQuantile(log_weights, values, 0.5);
  summary.q95 = WeightedQuantile(log_weights, values, 0.95);
  summary.prior_sd = prior.StandardDeviation();
  summary.at_bound =
      MassWhere(log_weights, values, -kInfinity, prior.Quantile(kOuterShare)) > kBoundShare ||
      MassWhere(log_weights, values, prior.Quantile(1 - kOuterShare), kInfinity) > kBoundShare;
  return summary;
}

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
    return warnings;
  }
  const bool heavy = posterior.pareto_k > kLargestParetoIndex;
  if (posterior.ess < kLeastEss || heavy) {
    warnings.push_back(
        absl::StrCat("The posterior rests on ", std::floor(posterior.ess * 10) / 10,
                     " effective samples of ", total, " and the Pareto index of its weights is ",
                     std::round(posterior.pareto_k * 100) / 100, " (wanted: at least ", kLeastEss,
                     " and at most ", kLargestParetoIndex,
                     "); standard deviations, quantiles and evidence are not reliable. Run more "
                     "iterations or samples, or "
                     "sample the posterior on an emulator of the model."));
  }
  return warnings;
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
        Summarize(priors[j], log_weights, ensemble->parameters.col(j), mean[j], covariance(j, j)));
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
  return posterior;
}

}  // namespace calib::inference
