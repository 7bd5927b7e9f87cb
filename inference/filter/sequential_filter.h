#pragma once
// Sequential importance sampling along the readings [Cheng 2019, Eqs. 13-17], in log space.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// Ranges of readings that make one load step each, in processing order: step s of S holds the
/// readings offsets[s] ... offsets[s + 1] - 1.
struct StepOffsets {
  std::vector<int> offsets;                                           ///< S + 1, ascending
  int steps() const { return static_cast<int>(offsets.size()) - 1; }  ///< S
};

/// Weights, moments and evidence of N samples of d parameters after each of S load steps.
struct SequentialResult {
  Eigen::MatrixXd
      log_weights;      ///< N x S, normalised after each step; the last column is the posterior
  Eigen::VectorXd ess;  ///< S, 1 / (N sum w^2) in (0, 1]
  Eigen::MatrixXd mean, cov;  ///< S x d; cov = sd / |mean|, NaN where the mean is zero
  /// S: ln sum_i w_{s-1,i} p(y_s | x_i), the increments of ln p(y_1 ... y_s), with w_0 the start
  /// weights normalised to one.
  Eigen::VectorXd log_evidence_increments;
};

/// Takes the readings into the weights: ln w_t = ln w_{t-1} + ln p(y_t | x_t), normalised after
/// each load step. Pure.
///                                                                             [Cheng 2019, Eq. 14]
/// in: log_start N, not necessarily normalised (-infinity: sample does not count), at least one
///     finite; increments N x T, ln p(y_t | earlier, x) of each reading, finite for samples that
///     count; steps, of these T readings; parameters N x d
SequentialResult SequentialFilter(const Eigen::VectorXd& log_start,
                                  const Eigen::MatrixXd& increments, const StepOffsets& steps,
                                  const Eigen::MatrixXd& parameters);

}  // namespace calib::inference
