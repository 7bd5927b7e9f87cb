#pragma once
// Weights in log space. Sums run in index order, so that equal input gives equal bits.

#include <Eigen/Core>

namespace calib::inference {

/// ln sum_i exp(v_i), relative to the largest entry; -inf when all are -inf or there are none.
/// Entries: no NaN, no +inf.
double LogSumExp(const Eigen::VectorXd& values);

/// values - LogSumExp(values), so that the weights exp(.) sum to one; all -inf stay so.
Eigen::VectorXd NormalizedLogWeights(const Eigen::VectorXd& values);

/// 1 / sum_i w_i^2 of the normalised weights, in [1, n]; 0 when all weights are zero.
/// [Cheng 2019, sec. 3.4, times N]
double EffectiveSampleSize(const Eigen::VectorXd& log_weights);

}  // namespace calib::inference
