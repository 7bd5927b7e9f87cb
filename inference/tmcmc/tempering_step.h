#pragma once
// The numerical choices of a tempering stage: how far the exponent goes, and shape and scale of the
// proposal.

#include <Eigen/Core>
#include <cstddef>

namespace calib::inference {

struct TemperingStep {
  double exponent = 0;  ///< the next one, in (exponent before, 1]
  double cv = 0;  ///< coefficient of variation of the weights, those of -inf likelihood left out
  double log_mean_weight =
      0;  ///< ln of the mean weight over all samples: the stage's factor of the evidence
  Eigen::VectorXd weights;  ///< exp((next - before) log likelihood), normalised to sum one
};

/// The largest exponent at which the weights' coefficient of variation does not exceed target_cv,
/// by bisection to 1e-12 relative: the coefficient grows with the exponent [Ching & Chen 2007, Eq.
/// 12]. Diverged samples (-inf) have weight zero at any exponent and do not count in the choice.
/// in: log_likelihood, no NaN, at least one entry above -inf; exponent in [0, 1); target_cv > 0
TemperingStep NextExponent(const Eigen::VectorXd& log_likelihood, double exponent,
                           double target_cv);

/// Lower Cholesky factor of the weighted covariance of the rows (N x d), weights summing to one.
/// Directions without spread get 1e-6 of the largest one, so that a degenerate population can still
/// move.
Eigen::MatrixXd WeightedCovarianceFactor(const Eigen::MatrixXd& rows,
                                         const Eigen::VectorXd& weights);

/// Of the factor of the proposal's covariance, 2.38 / sqrt(d) [Roberts et al. 1997].
double FirstScale(std::size_t d);

/// Steers the scale to the acceptance wanted, within [1e-3, 2] of the first. What a step did to all
/// N samples is known only after it, so the next step's proposal does not depend on the sample it
/// moves, up to 1/N. accepted: share of the samples, [0, 1].
double NextScale(double scale, std::size_t d, double accepted, double wanted);

}  // namespace calib::inference
