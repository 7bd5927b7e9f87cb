#include "inference/diagnosis/twin_scatter.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kLeastRatio = 1e-6;  // of variances: a coordinate that twins do not move in

// Mean and variance of ln of a variance estimate over the true one.
struct LogVariance {
  explicit LogVariance(double freedom)
      : mean(Digamma(freedom / 2) - std::log(freedom / 2)), variance(Trigamma(freedom / 2)) {}
  double mean, variance;

 private:
  // [Abramowitz & Stegun 6.4.6, 6.4.12]
  static double Trigamma(double x) {
    double sum = 0;
    while (x < 6) {
      sum += 1 / (x * x);
      x += 1;
    }
    return sum + 1 / x + 1 / (2 * x * x) + 1 / (6 * x * x * x) - 1 / (30 * std::pow(x, 5));
  }
};

}  // namespace

TwinScatter SplitByTwins(const Eigen::MatrixXd& twins, const Eigen::VectorXd& residual,
                         double freedom) {
  const Index q = residual.size();
  assert(twins.rows() >= 2 && twins.cols() == q && freedom > 0 && residual.minCoeff() > 0);
  const double twin_freedom = static_cast<double>(twins.rows()) - 1;
  const LogVariance of_twins(twin_freedom), of_residual(freedom);
  const Eigen::ArrayXd ratio =
      (twins.colwise().squaredNorm().transpose() / twin_freedom).cwiseQuotient(residual);
  const Eigen::ArrayXd seen = ratio.max(kLeastRatio).log() - (of_twins.mean - of_residual.mean);
  const double chance = of_twins.variance + of_residual.variance;
  const auto n = static_cast<double>(q);
  const double mean = seen.mean();
  const double between = q > 1 ? std::max(0.0, (seen - mean).square().sum() / (n - 1) - chance) : 0;
  const double own = between / (between + chance);  // weight of a coordinate's twins
  const double rest = (1 - own) * (1 - own);
  const double variance = own * own * of_twins.variance + rest * of_residual.variance +
                          rest * (between + (between + chance) / n);
  TwinScatter result;
  result.specimen = residual.array() * (mean + own * (seen - mean)).exp();
  result.missed = (residual - result.specimen).cwiseMax(0);
  result.freedom = std::min(freedom, 2 / variance);
  return result;
}

}  // namespace calib::inference
