#pragma once
// The numerical choices of a tempering stage: how far the exponent goes, and shape and scale of the
// proposal. Pure functions.

#include <Eigen/Core>
#include <cstddef>

namespace calib::inference {

/// How far a stage of N samples goes.
struct TemperingStep {
  double exponent = 0;  ///< the next one, in (exponent before, 1]
  /// Coefficient of variation of the weights, those of -infinite likelihood left out.
  double cv = 0;
  /// ln of the mean weight over all samples: the stage's factor of the evidence.
  double log_mean_weight = 0;
  Eigen::VectorXd weights;  ///< N: exp((next - before) log likelihood), normalised to sum one
};

/// The step to the largest exponent at which the weights' coefficient of variation does not exceed
/// target_cv, by bisection to 1e-12 relative: the coefficient grows with the exponent. Diverged
/// samples (-infinity) have weight zero at any exponent and do not count in the choice.
///                                                                      [Ching & Chen 2007, Eq. 12]
/// in: log_likelihood, N, no NaN, at least one entry above -infinity; exponent, the one before, in
///     [0, 1); target_cv > 0
TemperingStep NextExponent(const Eigen::VectorXd& log_likelihood, double exponent,
                           double target_cv);

/// Lower Cholesky factor, d x d, of the weighted covariance of the rows (N x d), weights (N)
/// summing to one. Directions without spread get a standard deviation of 1e-6 of the largest one,
/// so that a degenerate population can still move.
Eigen::MatrixXd WeightedCovarianceFactor(const Eigen::MatrixXd& rows,
                                         const Eigen::VectorXd& weights);

/// Scale of the factor of the proposal's covariance that a random walk in d dimensions begins with,
/// 2.38 / sqrt(d) [Roberts, Gelman & Gilks 1997].
double FirstScale(std::size_t d);

/// The next step's scale of the proposal in d dimensions, steered to the acceptance wanted, within
/// [1e-3, 2] times FirstScale(d). What a step did to all N samples is known only after it, so the
/// next step's proposal does not depend on the sample it moves, up to 1/N. accepted: share of the
/// samples whose last step was accepted, [0, 1]; wanted: (0, 1).
double NextScale(double scale, std::size_t d, double accepted, double wanted);

}  // namespace calib::inference
