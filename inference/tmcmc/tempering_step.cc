#include "inference/tmcmc/tempering_step.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kExponentTolerance = 1e-12;  // of the bisection, relative
// Standard deviation of a direction over the largest that counts as none; chosen.
constexpr double kNoSpread = 1e-6;
constexpr double kNoVariance = 1e-12;  // its square
constexpr double kOptimal = 2.38;      // [Roberts, Gelman & Gilks 1997]
// How the scale follows the acceptance; chosen: a step that accepts 0.1 too little makes it 18 %
// smaller, and it stays within what any acceptance can ask for.
constexpr double kGain = 2;
constexpr double kLeastOfFirst = 1e-3;  // over the first one
constexpr double kMostScale = 2;        // over the first one

// Coefficient of variation of exp(increment * relative), over the finite entries.
double Variation(const Eigen::VectorXd& relative, double increment) {
  double count = 0;
  double sum = 0;
  double sum_of_squares = 0;
  for (const double value : relative) {
    if (std::isinf(value)) continue;
    const double weight = std::exp(increment * value);
    ++count;
    sum += weight;
    sum_of_squares += weight * weight;
  }
  const double mean = sum / count;
  return std::sqrt(std::max(0.0, sum_of_squares / count - mean * mean)) / mean;
}

}  // namespace

TemperingStep NextExponent(const Eigen::VectorXd& log_likelihood, double exponent,
                           double target_cv) {
  double largest = -std::numeric_limits<double>::infinity();
  for (const double value : log_likelihood) largest = std::max(largest, value);
  const Eigen::VectorXd relative = log_likelihood.array() - largest;

  double high = 1 - exponent;
  double low = 0;
  if (Variation(relative, high) <= target_cv) {
    low = high;
  } else {
    while (high - low > kExponentTolerance * high) {
      const double middle = 0.5 * (low + high);
      (Variation(relative, middle) <= target_cv ? low : high) = middle;
    }
    if (low == 0)
      low = high;  // no exponent is small enough: the smallest step that bisection knows
  }
  TemperingStep step;
  step.exponent = low == 1 - exponent ? 1 : exponent + low;
  step.cv = Variation(relative, low);
  step.weights.resize(relative.size());
  double sum = 0;
  for (Index i = 0; i < relative.size(); ++i) sum += step.weights[i] = std::exp(low * relative[i]);
  step.log_mean_weight = low * largest + std::log(sum / static_cast<double>(relative.size()));
  step.weights /= sum;
  return step;
}

Eigen::MatrixXd WeightedCovarianceFactor(const Eigen::MatrixXd& rows,
                                         const Eigen::VectorXd& weights) {
  const Index d = rows.cols();
  Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(d);
  for (Index i = 0; i < rows.rows(); ++i) mean += weights[i] * rows.row(i);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(d, d);
  for (Index i = 0; i < rows.rows(); ++i) {
    const Eigen::RowVectorXd difference = rows.row(i) - mean;
    covariance += weights[i] * difference.transpose() * difference;
  }
  const double largest =
      std::max(covariance.diagonal().maxCoeff(), std::numeric_limits<double>::min());
  Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success ||
      factor.matrixL().toDenseMatrix().diagonal().minCoeff() < kNoSpread * std::sqrt(largest)) {
    covariance.diagonal().array() += kNoVariance * largest;
    factor.compute(covariance);
  }
  return factor.matrixL();
}

double FirstScale(std::size_t d) { return kOptimal / std::sqrt(static_cast<double>(d)); }

double NextScale(double scale, std::size_t d, double accepted, double wanted) {
  const double first = FirstScale(d);
  return std::clamp(scale * std::exp(kGain * (accepted - wanted)), kLeastOfFirst * first,
                    kMostScale * first);
}

}  // namespace calib::inference
