#pragma once
// Weights in log space. Sums run in index order, so that equal input gives equal bits. Pure
// functions; -infinity stands for a weight of zero.

#include <Eigen/Core>

namespace calib::inference {

/// ln sum_i exp(v_i), summed relative to the largest entry; -infinity when all entries are or there
/// are none. Entries: no NaN, no +infinity.
double LogSumExp(const Eigen::VectorXd& values);

/// values - LogSumExp(values): logarithms of weights exp(.) that sum to one. All -infinity:
/// unchanged.
Eigen::VectorXd NormalizedLogWeights(const Eigen::VectorXd& values);

/// Effective number of samples, (sum_i w_i)^2 / sum_i w_i^2 of w_i = exp(log_weights_i), normalised
/// or not, in [1, n]; 0 when all weights are zero.                  [Cheng 2019, sec. 3.4, times N]
double EffectiveSampleSize(const Eigen::VectorXd& log_weights);

}  // namespace calib::inference
