#pragma once
// Moments and quantiles of weighted samples. Weights are given as normalised logs; sums run in
// index order.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// sum_i w_i x_i per column; d.                                               [Cheng 2019, Eq. 16]
/// Summed relative to the first row, so that columns far from zero keep their digits.
Eigen::VectorXd WeightedMean(const Eigen::VectorXd& log_weights, const Eigen::MatrixXd& values);

/// sum_i w_i (x_i - mean)(x_i - mean)^T, d x d.                               [Cheng 2019, Eq. 17]
Eigen::MatrixXd WeightedCovariance(const Eigen::VectorXd& log_weights,
                                   const Eigen::MatrixXd& values, const Eigen::VectorXd& mean);

/// Correlation matrix of a covariance; a coordinate without variance has correlation zero with the
/// others.
Eigen::MatrixXd CorrelationOf(const Eigen::MatrixXd& covariance);

/// Quantile of probability p in (0, 1): piecewise linear through (cumulative weight before x_i +
/// w_i / 2, x_i) in ascending order of x, constant beyond the first and last. Samples of weight
/// zero play no part.
double WeightedQuantile(const Eigen::VectorXd& log_weights, const Eigen::VectorXd& values,
                        double p);

/// The same for ascending probabilities, one pass over samples sorted once; as many as p.
std::vector<double> WeightedQuantiles(const Eigen::VectorXd& log_weights,
                                      const Eigen::VectorXd& values, const std::vector<double>& p);

}  // namespace calib::inference
