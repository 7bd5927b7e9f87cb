#include "inference/numerics/log_weights.h"

#include <algorithm>
#include <cmath>

#include "inference/numerics/infinity.h"

namespace calib::inference {
namespace {

double Largest(const Eigen::VectorXd& values) {
  double largest = -kInfinity;
  for (const double value : values) largest = std::max(largest, value);
  return largest;
}

}  // namespace

double LogSumExp(const Eigen::VectorXd& values) {
  const double largest = Largest(values);
  if (largest == -kInfinity) return -kInfinity;
  double sum = 0;
  for (const double value : values) sum += std::exp(value - largest);
  return largest + std::log(sum);
}

Eigen::VectorXd NormalizedLogWeights(const Eigen::VectorXd& values) {
  const double largest = Largest(values);
  if (largest == -kInfinity) return values;
  // The largest is taken off first: subtracting ln(sum) + largest at once would lose digits of
  // small differences.
  const Eigen::VectorXd relative = values.array() - largest;
  return relative.array() - LogSumExp(relative);
}

double EffectiveSampleSize(const Eigen::VectorXd& log_weights) {
  const double largest = Largest(log_weights);
  if (largest == -kInfinity) return 0;
  double sum = 0;
  double sum_of_squares = 0;
  for (const double value : log_weights) {
    const double weight = std::exp(value - largest);
    sum += weight;
    sum_of_squares += weight * weight;
  }
  return sum * sum / sum_of_squares;
}

}  // namespace calib::inference
