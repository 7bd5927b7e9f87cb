// The posterior and its path from all finished iterations.

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "inference/evidence/importance_evidence.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/log_weights.h"
#include "inference/filter/parameter_summary.h"
#include "inference/filter/sequential_filter.h"
#include "inference/filter/weighted_moments.h"
#include "inference/sampling/halton.h"
#include "inference/sampling/shuffle.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastEss = 50;
constexpr double kLeastTempered = 2;
constexpr double kLargestParetoIndex = 0.7;

PosteriorPath MakePath(const DataSet& data, const Ensemble& ensemble,
                       const Eigen::MatrixXd& increments) {
  const StepOffsets steps = LoadSteps(data);
  const SequentialResult along =
      SequentialFilter(ensemble.log_start, increments, steps, ensemble.parameters);
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

// The readings taken in from the last to the first: where they depend on each other, each given
// those after it. Final weights and evidence stay those of the forward order, up to rounding.
absl::StatusOr<PosteriorPath> MakeReversedPath(const DataSet& data, const FilterOptions& options,
                                               const Ensemble& ensemble) {
  const DataSet reversed = Reversed(data);
  const auto likelihood = LikelihoodOf(ensemble, reversed, options);
  if (!likelihood.ok()) return likelihood.status();
  return MakePath(reversed, ensemble, IncrementsOf(*likelihood, ensemble.used, true));
}

// Quantiles of sqrt(f) over the posterior, by equally probable draws: sample by sample the factor
// is inverse gamma.
absl::StatusOr<Eigen::MatrixXd> NoiseScale(const DataSet& data, const FilterOptions& options,
                                           const Ensemble& ensemble,
                                           const Eigen::VectorXd& log_weights) {
  constexpr int kDraws = 2000;
  const auto likelihood = LikelihoodOf(ensemble, data, options);
  if (!likelihood.ok()) return likelihood.status();
  Eigen::VectorXd shapes;
  Eigen::MatrixXd rates;
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    const auto factors = likelihood->VarianceFactors(iteration.predictions);
    shapes = factors.shapes;
    rates.conservativeResize(log_weights.size(), shapes.size());
    rates.middleRows(row, factors.rates.rows()) = factors.rates;
    row += factors.rates.rows();
  }
  Eigen::MatrixXd scale(shapes.size(), 3);
  std::vector<double> draws(kDraws);
  for (Eigen::Index g = 0; g < scale.rows(); ++g) {
    Eigen::Index i = 0;  // the last sample of positive weight passed
    Eigen::Index next = 0;
    double passed = 0;
    for (int m = 0; m < kDraws; ++m) {
      for (; passed < (m + 0.5) / kDraws && next < log_weights.size(); ++next) {
        const double weight = std::exp(log_weights[next]);
        if (weight > 0) i = next;
        passed += weight;
      }
      const double u = RadicalInverse(static_cast<std::uint64_t>(m) + 1, 2);
      draws[static_cast<std::size_t>(m)] =
          std::sqrt(rates(i, g) / boost::math::gamma_q_inv(shapes[g], u));
    }
    std::sort(draws.begin(), draws.end());
    scale.row(g) << draws[kDraws / 20], draws[kDraws / 2], draws[kDraws - 1 - kDraws / 20];
  }
  return scale;
}

// ln L = const - chi^2 / 2 with stated errors, the constant that of zero residuals.
double PredictiveP(const DataSet& data, const Ensemble& ensemble,
                   const Eigen::VectorXd& log_weights) {
  // In double alone: in long double it was a sixth of the time of a posterior.
  using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kGiven);
  double p = 0;
  if (!likelihood.ok()) return std::numeric_limits<double>::quiet_NaN();
  const auto readings = static_cast<Eigen::Index>(data.readings.size());
  const double perfect = likelihood->LogLikelihoodBound(
      Eigen::MatrixXd::Constant(1, readings, std::numeric_limits<double>::quiet_NaN()))[0];
  for (Eigen::Index i = 0; i < log_weights.size(); ++i) {
    const double weight = std::exp(log_weights[i]);
    if (weight < 1e-12) continue;
    const double half = std::max(0.0, perfect - ensemble.log_likelihood[i]);
    p += weight * boost::math::gamma_q(0.5 * static_cast<double>(readings), half, Policy());
  }
  return p;
}

// Differences of the means of two halves of the samples over sd.
Eigen::VectorXd SplitHalf(const Ensemble& ensemble, const Eigen::VectorXd& log_weights,
                          const std::vector<ParameterSummary>& parameters) {
  const Eigen::Index d = ensemble.parameters.cols();
  const std::vector<int> half = Halves(log_weights.size());
  double mass[2] = {0, 0};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(2, d);
  for (Eigen::Index i = 0; i < log_weights.size(); ++i) {
    const double weight = std::exp(log_weights[i]);
    const int own = half[static_cast<std::size_t>(i)];
    mass[own] += weight;
    for (Eigen::Index j = 0; j < d; ++j)
      sums(own, j) += weight * (ensemble.parameters(i, j) - parameters[j].mean);
  }
  Eigen::VectorXd difference(d);
  for (Eigen::Index j = 0; j < d; ++j) {
    difference[j] = std::abs(sums(0, j) / mass[0] - sums(1, j) / mass[1]) / parameters[j].sd;
  }
  return difference;
}

// What is held has no uncertainty to state.
void MarkFrozen(const Ensemble& ensemble, Posterior& posterior) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t j = 0; j < ensemble.frozen.size(); ++j) {
    if (!ensemble.frozen[j]) continue;
    ParameterSummary& parameter = posterior.parameters[j];
    parameter.mean = *ensemble.frozen[j];
    parameter.sd = parameter.cov = parameter.q05 = parameter.q50 = parameter.q95 = kNone;
    parameter.at_bound = false;
    posterior.split_half[static_cast<Eigen::Index>(j)] = kNone;
  }
}

std::vector<std::string> Warnings(const FilterOptions& options, const Ensemble& ensemble,
                                  const Posterior& posterior) {
  std::vector<std::string> warnings;
  const auto total = static_cast<double>(ensemble.log_start.size());
  if (ensemble.diverged > 0) {
    warnings.push_back(
        absl::StrCat(ensemble.diverged, " of ", total,
                     " samples did not come to their ends (diverged, or stopped early because they "
                     "could not matter) and have weight zero."));
  }
  if (ensemble.outside > 0) {
    warnings.push_back(absl::StrCat(
        ensemble.outside, " of ", total, " samples lie outside the prior and have weight zero",
        ensemble.strangers > 0 ? "; the others count as draws from it." : "."));
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
  if (options.noise == NoiseMode::kEssTarget) {  // the weights are what sigma makes of them
    if (posterior.ess >= kLeastTempered) return "";
    return absl::StrCat(
        "Only ", std::floor(posterior.ess * 10) / 10, " of ", ensemble.log_start.size(),
        " samples are effective, so that nothing can be said about the parameters' spread: see why "
        "others did not come to their ends, run more samples, or raise ess_target.");
  }
  const bool heavy = posterior.pareto_k > kLargestParetoIndex;
  if (posterior.ess >= kLeastEss && !heavy) return "";
  return absl::StrCat(
      "The weighted samples alone do not make a posterior: ", std::floor(posterior.ess * 10) / 10,
      " of ", ensemble.log_start.size(), " are effective and the Pareto index of their weights ",
      std::isfinite(posterior.pareto_k)
          ? absl::StrCat("is ", std::round(posterior.pareto_k * 100) / 100)
          : "cannot be estimated from so few",
      " (wanted: at least ", kLeastEss, " and at most ", kLargestParetoIndex, ").");
}

// The weights that the evidence is the mean of: without those of strangers, which are zero.
Eigen::VectorXd WithoutStrangers(const Ensemble& ensemble, const Eigen::VectorXd& log_weights) {
  Eigen::VectorXd own(log_weights.size() - ensemble.strangers);
  Eigen::Index left_out = 0;
  Eigen::Index kept = 0;
  for (const double weight : log_weights) {
    if (weight == -kInfinity && left_out < ensemble.strangers) {
      ++left_out;
    } else {
      own[kept++] = weight;
    }
  }
  return own;
}

}  // namespace

absl::StatusOr<Posterior> ComputePosterior(const JointPrior& priors, const DataSet& data,
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
    posterior.parameters.push_back(Summarize(priors[j], log_weights, ensemble->parameters.col(j)));
  }
  posterior.correlation = CorrelationOf(covariance);
  const EvidenceEstimate evidence = ImportanceEvidence(WithoutStrangers(*ensemble, unnormalized));
  posterior.log_evidence = evidence.log_evidence;
  posterior.log_evidence_se = evidence.standard_error;
  posterior.ess = EffectiveSampleSize(log_weights);
  posterior.pareto_k = ParetoTailIndex(log_weights);
  posterior.sigma = ensemble->sigma;
  posterior.path = MakePath(data, *ensemble, ensemble->increments);
  if (options.reversed_path) {
    auto reversed = MakeReversedPath(data, options, *ensemble);
    if (!reversed.ok()) return reversed.status();
    posterior.reversed_path = *std::move(reversed);
  }
  if (options.noise == NoiseMode::kInferred) {
    auto scale = NoiseScale(data, options, *ensemble, log_weights);
    if (!scale.ok()) return scale.status();
    posterior.noise_scale = *std::move(scale);
  }
  if (options.noise == NoiseMode::kGiven) {
    posterior.predictive_p = PredictiveP(data, *ensemble, log_weights);
  }
  posterior.split_half = SplitHalf(*ensemble, log_weights, posterior.parameters);
  posterior.frozen = ensemble->frozen;
  MarkFrozen(*ensemble, posterior);
  posterior.warnings = Warnings(options, *ensemble, posterior);
  posterior.degeneracy = Degeneracy(options, *ensemble, posterior);
  return posterior;
}

}  // namespace calib::inference
