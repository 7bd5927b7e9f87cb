#pragma once
// What a posterior of N weighted samples says about itself beside its moments. log_weights are the
// logarithms of weights that sum to one, N entries. Pure functions.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/scatter/chi_squared_law.h"

namespace calib::inference {

/// Posterior::noise_scale: quantiles (5, 50, 95 %) of sqrt(f) over the posterior of the variance
/// factor f of each of G noise groups, G x 3, by 2000 equally probable draws: given a sample the
/// factor is inverse gamma. factors: of the samples, N rows of rates.
Eigen::MatrixXd NoiseScale(const GaussianLikelihood::FactorPosterior& factors,
                           const Eigen::VectorXd& log_weights);

/// Posterior::model_errors: the data's model errors over the posterior, those without readings left
/// out. likelihood: of the data, with NoiseMode::kModelError; predictions: of the samples, N x T;
/// samples of next to no weight (1e-12) are passed over.
std::vector<ModelErrorSummary> ModelErrorsOver(const GaussianLikelihood& likelihood,
                                               const DataSet& data,
                                               const Eigen::MatrixXd& predictions,
                                               const Eigen::VectorXd& log_weights);

/// Posterior::predictive_p of samples with these log likelihoods (N) by stated errors
/// (NoiseMode::kGiven); NaN for data that have no likelihood. known: how well the errors are known.
double PredictiveP(const DataSet& data, const Eigen::VectorXd& log_likelihood,
                   const Eigen::VectorXd& log_weights, const KnownFrom& known = {});

/// Posterior::split_half: for each of d parameters the difference of the weighted means of the
/// samples (N x d) of half 0 and of half 1 over the parameter's sd; NaN where a half has no weight.
/// halves: N numbers, 0 or 1; parameters: d, of all samples together.
Eigen::VectorXd HalvesDiffer(const Eigen::MatrixXd& samples, const Eigen::VectorXd& log_weights,
                             const std::vector<int>& halves,
                             std::span<const ParameterSummary> parameters);

}  // namespace calib::inference
