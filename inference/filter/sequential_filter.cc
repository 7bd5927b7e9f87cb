#include "inference/filter/sequential_filter.h"

#include <cassert>
#include <cmath>
#include <limits>

#include "inference/filter/log_weights.h"
#include "inference/filter/weighted_moments.h"

namespace calib::inference {

SequentialResult SequentialFilter(const Eigen::VectorXd& log_start,
                                  const Eigen::MatrixXd& increments, const StepOffsets& steps,
                                  const Eigen::MatrixXd& parameters) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Eigen::Index n = log_start.size();
  const Eigen::Index d = parameters.cols();
  assert(increments.rows() == n && parameters.rows() == n && steps.steps() >= 0);
  SequentialResult result;
  result.log_weights.resize(n, steps.steps());
  result.ess.resize(steps.steps());
  result.mean.resize(steps.steps(), d);
  result.cov.resize(steps.steps(), d);
  result.log_evidence_increments.resize(steps.steps());
  Eigen::VectorXd log_weights = NormalizedLogWeights(log_start);
  for (int s = 0; s < steps.steps(); ++s) {
    for (Eigen::Index i = 0; i < n; ++i) {
      if (log_weights[i] == -kInfinity) continue;
      for (int t = steps.offsets[s]; t < steps.offsets[s + 1]; ++t)
        log_weights[i] += increments(i, t);
    }
    result.log_evidence_increments[s] = LogSumExp(log_weights);
    log_weights = NormalizedLogWeights(log_weights);
    result.log_weights.col(s) = log_weights;
    result.ess[s] = EffectiveSampleSize(log_weights) / static_cast<double>(n);
    const Eigen::VectorXd mean = WeightedMean(log_weights, parameters);
    const Eigen::VectorXd variance = WeightedCovariance(log_weights, parameters, mean).diagonal();
    for (Eigen::Index j = 0; j < d; ++j) {
      result.mean(s, j) = mean[j];
      result.cov(s, j) = mean[j] == 0 ? std::numeric_limits<double>::quiet_NaN()
                                      : std::sqrt(variance[j]) / std::abs(mean[j]);
    }
  }
  return result;
}

}  // namespace calib::inference
