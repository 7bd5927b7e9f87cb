#include "inference/filter/sequential_filter.h"

#include <cassert>
#include <cmath>
#include <limits>

#include "inference/filter/log_weights.h"

namespace calib::inference {

SequentialResult SequentialFilter(const Eigen::VectorXd& log_start,
                                  const Eigen::MatrixXd& increments, const StepOffsets& steps,
                                  const Eigen::MatrixXd& parameters) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr double kSmallest = -745;  // below it exp is zero
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
  Eigen::VectorXd weights(n);
  for (int s = 0; s < steps.steps(); ++s) {
    for (int t = steps.offsets[s]; t < steps.offsets[s + 1]; ++t) {
      for (Eigen::Index i = 0; i < n; ++i) {
        if (log_weights[i] > -kInfinity) log_weights[i] += increments(i, t);
      }
    }
    // One exponential per sample: weights relative to the largest serve everything.
    const double largest = log_weights.maxCoeff();
    double sum = 0;
    double squares = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double relative = log_weights[i] - largest;
      weights[i] = relative > kSmallest ? std::exp(relative) : 0;
      sum += weights[i];
      squares += weights[i] * weights[i];
    }
    const double log_sum = std::log(sum);
    result.log_evidence_increments[s] = largest + log_sum;
    // The largest is taken off first: subtracting largest + log_sum at once would lose digits of
    // small differences.
    log_weights = (log_weights.array() - largest) - log_sum;
    result.log_weights.col(s) = log_weights;
    result.ess[s] = sum * sum / (squares * static_cast<double>(n));
    for (Eigen::Index j = 0; j < d; ++j) {
      double shift = 0;
      for (Eigen::Index i = 0; i < n; ++i) {
        shift += weights[i] * (parameters(i, j) - parameters(0, j));
      }
      const double mean = parameters(0, j) + shift / sum;
      double variance = 0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const double difference = parameters(i, j) - mean;
        variance += weights[i] * difference * difference;
      }
      result.mean(s, j) = mean;
      result.cov(s, j) = mean == 0 ? std::numeric_limits<double>::quiet_NaN()
                                   : std::sqrt(variance / sum) / std::abs(mean);
    }
  }
  return result;
}

}  // namespace calib::inference
