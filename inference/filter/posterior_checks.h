#pragma once
// What a posterior of weighted samples says about itself beside its moments.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/scatter/chi_squared_law.h"

namespace calib::inference {

/// Quantiles of sqrt(f) of each noise group over the posterior, G x 3 (5, 50, 95 %), by equally
/// probable draws: given a sample the factor is inverse gamma. log_weights: N, normalised, of the
/// rows of factors.rates.
Eigen::MatrixXd NoiseScale(const GaussianLikelihood::FactorPosterior& factors,
                           const Eigen::VectorXd& log_weights);

/// Posterior::predictive_p of samples with these ln L by stated errors (NoiseMode::kGiven); NaN for
/// data that have none. Both N, log_weights normalised. known: of the errors.
double PredictiveP(const DataSet& data, const Eigen::VectorXd& log_likelihood,
                   const Eigen::VectorXd& log_weights, const KnownFrom& known = {});

/// Posterior::split_half: differences, d, of the means of the samples (N x d) of half 0 and of half
/// 1 over the parameters' sd; NaN where a half has no weight. log_weights, halves: N.
Eigen::VectorXd SplitHalf(const Eigen::MatrixXd& samples, const Eigen::VectorXd& log_weights,
                          const std::vector<int>& halves,
                          std::span<const ParameterSummary> parameters);

}  // namespace calib::inference
