// The posterior and its path from all finished iterations.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/evidence/importance_evidence.h"
#include "inference/evidence/lost_modes.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/parameter_summary.h"
#include "inference/filter/posterior_checks.h"
#include "inference/filter/sequential_filter.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/shuffle.h"

namespace calib::inference {
namespace {

constexpr double kLeastEss = 50;             // chosen: a mean is then known to 0.14 sd
constexpr double kLeastTempered = 2;         // chosen: of one sample there is no spread
constexpr double kLargestParetoIndex = 0.7;  // [Vehtari et al. 2024]
constexpr double kLeastLost = 0.05;          // of ln Z; chosen: less moves no interval that matters

bool WeightsSuffice(const Posterior& posterior) {
  return posterior.ess >= kLeastEss && !(posterior.pareto_k > kLargestParetoIndex);
}

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
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodOf(ensemble, reversed, options));
  return MakePath(reversed, ensemble, IncrementsOf(likelihood, ensemble.used, true));
}

// Posterior::noise_scale of all iterations together.
absl::StatusOr<Eigen::MatrixXd> NoiseScaleOf(const DataSet& data, const FilterOptions& options,
                                             const Ensemble& ensemble,
                                             const Eigen::VectorXd& log_weights) {
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodOf(ensemble, data, options));
  GaussianLikelihood::FactorPosterior all;
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    const auto factors = likelihood.VarianceFactors(iteration.predictions);
    all.shapes = factors.shapes;
    all.rates.conservativeResize(log_weights.size(), all.shapes.size());
    all.rates.middleRows(row, factors.rates.rows()) = factors.rates;
    row += factors.rates.rows();
  }
  return NoiseScale(all, log_weights);
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

// Posterior::model_errors of all iterations together.
absl::StatusOr<std::vector<ModelErrorSummary>> ModelErrorsOf(const DataSet& data,
                                                             const FilterOptions& options,
                                                             const Ensemble& ensemble,
                                                             const Eigen::VectorXd& log_weights) {
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodOf(ensemble, data, options));
  Eigen::MatrixXd predictions(log_weights.size(), likelihood.readings());
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    predictions.middleRows(row, iteration.predictions.rows()) = iteration.predictions;
    row += iteration.predictions.rows();
  }
  return ModelErrorsOver(likelihood, data, predictions, log_weights);
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
        ensemble.strangers > ensemble.aside ? "; the others count as draws from it." : "."));
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

// What the runs may say of a lost mode, in coordinates of the parameters that are not held. Nothing
// where the weights fall short anyway: then it is an emulator's to answer.
absl::StatusOr<LostModes> LostModesOf(const JointPrior& priors, const DataSet& data,
                                      const FilterOptions& options, const Ensemble& ensemble,
                                      const Posterior& posterior) {
  if (options.noise == NoiseMode::kEssTarget || !WeightsSuffice(posterior)) return LostModes{};
  std::vector<Eigen::Index> free;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    if (ensemble.frozen.empty() || !ensemble.frozen[j]) {
      free.push_back(static_cast<Eigen::Index>(j));
    }
  }
  const JointPrior of_free = free.size() < priors.size() ? priors.Of(free) : priors;
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodOf(ensemble, data, options));
  SampledModel model{.points = ensemble.parameters(Eigen::all, free),
                     .predictions = {},
                     .log_start = ensemble.log_start,
                     .log_likelihood = ensemble.log_likelihood,
                     .log_prior =
                         [&of_free](const Eigen::MatrixXd& points) {
                           Eigen::VectorXd density(points.rows());
                           for (Eigen::Index i = 0; i < points.rows(); ++i) {
                             density[i] = of_free.LogStandardDensity(
                                 of_free.FromStandard(points.row(i).transpose()));
                           }
                           return density;
                         },
                     .likelihood =
                         [&likelihood](const Eigen::MatrixXd& predictions) {
                           return likelihood.LogLikelihood(predictions);
                         }};
  for (Eigen::Index i = 0; i < model.points.rows(); ++i) {
    model.points.row(i) = of_free.ToStandard(model.points.row(i).transpose()).transpose();
  }
  model.predictions.resize(model.points.rows(), likelihood.readings());
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    model.predictions.middleRows(row, iteration.predictions.rows()) = iteration.predictions;
    row += iteration.predictions.rows();
  }
  return FindLostModes(model);
}

// Empty where no mode seems lost.
std::string LostModeSentence(const Ensemble& ensemble, const LostModes& lost) {
  if (lost.log_evidence <= kLeastLost) return "";
  return absl::StrCat("A mode may be lost: the runs about sample ",
                      ensemble.first + lost.modes.front().best,
                      " point to a fit near them that no sample has met, and leave at least ",
                      std::round(100 * -std::expm1(-lost.log_evidence)),
                      " % of the posterior there. More samples in each iteration would show it.");
}

// Empty where the weights are enough.
std::string Degeneracy(const FilterOptions& options, const Ensemble& ensemble,
                       const Posterior& posterior, const LostModes& lost) {
  if (options.noise == NoiseMode::kEssTarget) {  // the weights are what sigma makes of them
    if (posterior.ess >= kLeastTempered) return "";
    return absl::StrCat(
        "Only ", std::floor(posterior.ess * 10) / 10, " of ", ensemble.log_start.size(),
        " samples are effective, so that nothing can be said about the parameters' spread: see why "
        "others did not come to their ends, run more samples, or raise ess_target.");
  }
  if (WeightsSuffice(posterior)) return LostModeSentence(ensemble, lost);
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
                                           std::span<const Iteration> iterations,
                                           const KnownFrom& known) {
  ASSIGN_OR_RETURN(const auto ensemble, MakeEnsemble(priors, data, options, iterations));
  const Eigen::VectorXd unnormalized = ensemble.log_start + ensemble.log_likelihood;
  const Eigen::VectorXd log_weights = NormalizedLogWeights(unnormalized);

  Posterior posterior;
  posterior.log_weights =
      Eigen::VectorXd::Constant(ensemble.first + log_weights.size(), -kInfinity);
  posterior.log_weights.tail(log_weights.size()) = log_weights;
  const Eigen::VectorXd mean = WeightedMean(log_weights, ensemble.parameters);
  const Eigen::MatrixXd covariance = WeightedCovariance(log_weights, ensemble.parameters, mean);
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    posterior.parameters.push_back(Summarize(priors[j], log_weights, ensemble.parameters.col(j)));
  }
  posterior.correlation = CorrelationOf(covariance);
  const EvidenceEstimate evidence = ImportanceEvidence(WithoutStrangers(ensemble, unnormalized));
  posterior.log_evidence = evidence.log_evidence;
  posterior.ess = EffectiveSampleSize(log_weights);
  posterior.pareto_k = ParetoTailIndex(log_weights);
  ASSIGN_OR_RETURN(const LostModes lost, LostModesOf(priors, data, options, ensemble, posterior));
  posterior.log_evidence_se = std::hypot(evidence.standard_error, lost.log_evidence);
  posterior.sigma = ensemble.sigma;
  posterior.path = MakePath(data, ensemble, ensemble.increments);
  if (options.reversed_path) {
    ASSIGN_OR_RETURN(posterior.reversed_path, MakeReversedPath(data, options, ensemble));
  }
  if (options.noise == NoiseMode::kInferred) {
    ASSIGN_OR_RETURN(posterior.noise_scale, NoiseScaleOf(data, options, ensemble, log_weights));
  }
  if (options.noise == NoiseMode::kModelError) {
    ASSIGN_OR_RETURN(posterior.model_errors, ModelErrorsOf(data, options, ensemble, log_weights));
  }
  if (options.noise == NoiseMode::kGiven) {
    posterior.predictive_p = PredictiveP(data, ensemble.log_likelihood, log_weights, known);
  }
  posterior.split_half = HalvesDiffer(ensemble.parameters, log_weights, Halves(log_weights.size()),
                                      posterior.parameters);
  posterior.frozen = ensemble.frozen;
  MarkFrozen(ensemble, posterior);
  posterior.warnings = Warnings(options, ensemble, posterior);
  posterior.degeneracy = Degeneracy(options, ensemble, posterior, lost);
  return posterior;
}

}  // namespace calib::inference
