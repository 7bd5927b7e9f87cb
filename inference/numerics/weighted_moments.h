#pragma once
// Moments and quantiles of n weighted samples. log_weights are the logarithms of weights that sum
// to one, n entries (NormalizedLogWeights in log_weights.h); sums run in index order, so that equal
// input gives equal bits. Pure functions.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// Weighted mean sum_i w_i x_i of each column of values (n x d, n >= 1), d entries. Summed relative
/// to the first row, so that columns far from zero keep their digits.         [Cheng 2019, Eq. 16]
Eigen::VectorXd WeightedMean(const Eigen::VectorXd& log_weights, const Eigen::MatrixXd& values);

/// Weighted covariance sum_i w_i (x_i - mean)(x_i - mean)^T of the rows of values (n x d) about
/// `mean` (d), d x d; no small-sample correction.                             [Cheng 2019, Eq. 17]
Eigen::MatrixXd WeightedCovariance(const Eigen::VectorXd& log_weights,
                                   const Eigen::MatrixXd& values, const Eigen::VectorXd& mean);

/// Correlation matrix of a covariance matrix, d x d; a coordinate without variance has correlation
/// zero with the others.
Eigen::MatrixXd CorrelationOf(const Eigen::MatrixXd& covariance);

/// Quantile of probability p in (0, 1) of weighted values (n): piecewise linear through (cumulative
/// weight before x_i + w_i / 2, x_i) in ascending order of x, constant beyond the first and the
/// last. Samples of weight zero play no part; NaN where all are.
double WeightedQuantile(const Eigen::VectorXd& log_weights, const Eigen::VectorXd& values,
                        double p);

/// WeightedQuantile of each of the ascending probabilities p, by one pass over samples sorted once;
/// as many entries as p.
std::vector<double> WeightedQuantiles(const Eigen::VectorXd& log_weights,
                                      const Eigen::VectorXd& values, const std::vector<double>& p);

}  // namespace calib::inference
