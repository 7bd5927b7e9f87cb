#include "inference/evidence/pareto_tail.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"

namespace calib::inference {
namespace {

constexpr std::size_t kFewest = 5;  // excesses that a shape is fitted to [Vehtari et al. 2024]
constexpr double kPriorSpread = 3;  // of the candidates [Zhang & Stephens 2009, Eq. 4]
constexpr int kCandidates = 30;     // beside sqrt(n) more [Zhang & Stephens 2009]
constexpr double kShrinkage = 10;   // observations that the shape 1/2 counts as
//                                                                  [Vehtari et al. 2024, app. C]

}  // namespace

double GeneralizedParetoShape(const std::vector<double>& x) {
  const int n = static_cast<int>(x.size());
  assert(x.size() >= kFewest && x.front() > 0);
  // Candidates of theta = -k / scale, spread around the reciprocal of the first quartile.
  const int candidates = kCandidates + static_cast<int>(std::sqrt(n));
  const double quartile = x[static_cast<std::size_t>(std::floor(n / 4.0 + 0.5)) - 1];
  const auto shape_at = [&x, n](double theta) {
    double sum = 0;
    for (const double value : x) sum += std::log1p(-theta * value);
    return sum / n;
  };
  Eigen::VectorXd theta(candidates);
  Eigen::VectorXd log_likelihood(candidates);
  for (int j = 0; j < candidates; ++j) {
    theta[j] = 1 / x.back() + (1 - std::sqrt(candidates / (j + 0.5))) / (kPriorSpread * quartile);
    const double shape = shape_at(theta[j]);
    log_likelihood[j] = n * (std::log(-theta[j] / shape) - shape - 1);  // profile over the scale
  }
  const Eigen::VectorXd log_weights = NormalizedLogWeights(log_likelihood);
  double average = 0;
  for (int j = 0; j < candidates; ++j) average += std::exp(log_weights[j]) * theta[j];
  return (n * shape_at(average) + kShrinkage * 0.5) / (n + kShrinkage);
}

double ParetoTailIndex(const Eigen::VectorXd& log_weights) {
  const auto n = static_cast<double>(log_weights.size());
  const auto tail = static_cast<std::size_t>(std::ceil(std::min(n / 5, 3 * std::sqrt(n))));
  if (tail < kFewest) return kInfinity;
  std::vector<double> sorted(log_weights.begin(), log_weights.end());
  std::sort(sorted.begin(), sorted.end());
  const double threshold = sorted[sorted.size() - tail - 1];
  const double largest = sorted.back();
  if (sorted[sorted.size() - tail] == -kInfinity) return kInfinity;
  std::vector<double> excesses;
  for (std::size_t i = sorted.size() - tail; i < sorted.size(); ++i) {
    const double excess = std::exp(sorted[i] - largest) - std::exp(threshold - largest);
    if (excess > 0) excesses.push_back(excess);
  }
  // Equal weights have no tail; a few that stand out of equal (or underflowing) others are all
  // tail.
  if (excesses.empty()) return 0;
  if (excesses.size() < kFewest) return kInfinity;
  return GeneralizedParetoShape(excesses);
}

}  // namespace calib::inference
