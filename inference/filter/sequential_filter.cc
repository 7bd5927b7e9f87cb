#include "inference/filter/sequential_filter.h"

#include <cassert>
#include <cmath>
#include <cstring>

#include "inference/filter/parameter_summary.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/wide_exponential.h"

namespace calib::inference {
namespace {

// weights <- e^(log_weights - largest), n entries.
CALIB_INFERENCE_CLONES void RelativeWeights(const double* log_weights, double largest,
                                            Eigen::Index n, double* weights) {
  Lanes x;
  Eigen::Index i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    std::memcpy(&x, log_weights + i, sizeof(x));
    x -= largest;
    Exponential(x);
    std::memcpy(weights + i, &x, sizeof(x));
  }
  if (i == n) return;
  const auto rest = static_cast<std::size_t>(n - i) * sizeof(double);
  x = Lanes{};
  std::memcpy(&x, log_weights + i, rest);
  x -= largest;
  Exponential(x);
  std::memcpy(weights + i, &x, rest);
}

}  // namespace

SequentialResult SequentialFilter(const Eigen::VectorXd& log_start,
                                  const Eigen::MatrixXd& increments, const StepOffsets& steps,
                                  const Eigen::MatrixXd& parameters) {
  const Eigen::Index n = log_start.size();
  const Eigen::Index d = parameters.cols();
  assert(increments.rows() == n && parameters.rows() == n && steps.steps() >= 0);
  SequentialResult result;
  result.log_weights.resize(n, steps.steps());
  result.ess.resize(steps.steps());
  result.mean.resize(steps.steps(), d);
  result.cov.resize(steps.steps(), d);
  result.log_evidence_increments.resize(steps.steps());
  Eigen::ArrayXd log_weights = NormalizedLogWeights(log_start).array();
  // Increments of samples that do not count may be NaN.
  const bool all_count = log_weights.minCoeff() > -kInfinity;
  const Eigen::ArrayXd counted = (log_weights > -kInfinity).cast<double>();
  const Eigen::MatrixXd relative = parameters.rowwise() - parameters.row(0).eval();
  Eigen::ArrayXd weights(n);
  for (int s = 0; s < steps.steps(); ++s) {
    for (int t = steps.offsets[s]; t < steps.offsets[s + 1]; ++t) {
      if (all_count) {
        log_weights += increments.col(t).array();
      } else {
        log_weights = (counted > 0).select(log_weights + increments.col(t).array(), -kInfinity);
      }
    }
    // One exponential per sample: weights relative to the largest serve everything.
    const double largest = log_weights.maxCoeff();
    RelativeWeights(log_weights.data(), largest, n, weights.data());
    weights *= counted;
    const double sum = weights.sum();
    const double log_sum = std::log(sum);
    result.log_evidence_increments[s] = largest + log_sum;
    // The largest is taken off first: subtracting largest + log_sum at once would lose digits of
    // small differences.
    log_weights = (log_weights - largest) - log_sum;
    result.log_weights.col(s) = log_weights;
    result.ess[s] = sum * sum / (weights.square().sum() * static_cast<double>(n));
    const Eigen::VectorXd shift = relative.transpose() * weights.matrix() / sum;
    for (Eigen::Index j = 0; j < d; ++j) {
      const double mean = parameters(0, j) + shift[j];
      const double variance = (weights * (relative.col(j).array() - shift[j]).square()).sum() / sum;
      result.mean(s, j) = mean;
      result.cov(s, j) = CoefficientOfVariation(mean, std::sqrt(variance));
    }
  }
  return result;
}

}  // namespace calib::inference
