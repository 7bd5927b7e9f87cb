#pragma once
// Parameters joint with the states of their runs, for a mixture that tells apart what the
// parameters alone do not: the mixture of the augmented states (x, theta).
//                                                                    [Cheng 2019, sec. 3.2 and 3.5]

#include <Eigen/Core>

#include "inference/mixture/variational_steps.h"

namespace calib::inference {

/// Points of a parameter space with at most three more coordinates each, what the states of their
/// runs add: the leading principal components of the states' residuals about their weighted linear
/// regression on the points, each with at least 1 % of the weighted variance of the states, all
/// scaled to the mean variance of the points' coordinates. A mixture of Gaussians is fitted alike
/// to (theta, x) and to (theta, x - A theta): what is linear in the parameters adds nothing but a
/// singular covariance. Fewer coordinates, down to none, where the states are linear in the
/// parameters to within that 1 % or there are too few points for a regression (n <= d + 2). Pure,
/// deterministic.
/// in: parameters, d x n with counts n; states, n x T, finite, in units of their readings' errors
/// out: points (d + k) x n, 0 <= k <= 3, the first d rows and the counts those of `parameters`
WeightedPoints JoinStates(const WeightedPoints& parameters, const Eigen::MatrixXd& states);

}  // namespace calib::inference
