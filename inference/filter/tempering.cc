#include "inference/filter/tempering.h"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"

namespace calib::inference {
namespace {

constexpr double kPointsPerDecade = 24;  // chosen
// Exponents of the grid's ends, times the largest and the smallest gap of log likelihoods: beyond
// the one the best sample alone has weight (the others e^-60 of it), below the other the data move
// no weight by more than a part in a million. Chosen.
constexpr double kSharp = 60;
constexpr double kFlat = 1e-6;
constexpr double kRootTolerance = 1e-14;        // of ln exponent, times 1 + its size
constexpr std::uintmax_t kMostSteps = 200;      // of the root finder, which takes some ten
constexpr double kHumpTolerance = 1e-9;         // of ln exponent at a hump, flat there; chosen
constexpr double kGolden = 0.6180339887498949;  // (sqrt 5 - 1) / 2
// By how much a hump must exceed the effective samples at exponent zero, relative; chosen.
constexpr double kRises = 1e-6;

// The samples that count, their log likelihood relative to the best one: small differences keep
// their digits.
class EssCurve {
 public:
  explicit EssCurve(const TemperingProblem& problem) {
    double best = -kInfinity;
    std::vector<Eigen::Index> counted;
    for (Eigen::Index i = 0; i < problem.log_start.size(); ++i) {
      if (problem.log_start[i] == -kInfinity || problem.log_likelihood[i] == -kInfinity) continue;
      counted.push_back(i);
      best = std::max(best, problem.log_likelihood[i]);
    }
    start_.resize(static_cast<Eigen::Index>(counted.size()));
    relative_.resize(start_.size());
    for (Eigen::Index k = 0; k < start_.size(); ++k) {
      start_[k] = problem.log_start[counted[k]];
      relative_[k] = problem.log_likelihood[counted[k]] - best;
    }
  }

  bool empty() const { return start_.size() == 0; }
  double At(double exponent) const { return EffectiveSampleSize(start_ + exponent * relative_); }
  double AtZero() const { return EffectiveSampleSize(start_); }
  double StartSpread() const { return start_.maxCoeff() - start_.minCoeff(); }

  // Smallest and largest gap between a log likelihood and the best; {inf, 0} when all are equal.
  std::pair<double, double> Gaps() const {
    double smallest = kInfinity;
    double largest = 0;
    for (const double value : relative_) {
      if (value < 0) smallest = std::min(smallest, -value);
      largest = std::max(largest, -value);
    }
    return {smallest, largest};
  }

 private:
  Eigen::VectorXd start_, relative_;
};

}  // namespace

Tempering FindExponent(const TemperingProblem& problem) {
  const EssCurve curve(problem);
  const double unbounded = std::isinf(problem.max_exponent) ? 1 : problem.max_exponent;
  if (curve.empty()) return {.exponent = unbounded, .ess = 0, .reached = false};
  const auto [smallest, largest] = curve.Gaps();
  if (largest == 0) {
    const double ess = curve.AtZero();
    return {.exponent = unbounded, .ess = ess, .reached = ess >= problem.target};
  }
  // Above `sharp` the best sample alone has weight, whatever the start; below `flat` the data
  // change nothing.
  const double sharp = std::min(problem.max_exponent, (kSharp + curve.StartSpread()) / smallest);
  const double flat = std::min(kFlat / largest, 0.5 * sharp);
  const int points = 2 + static_cast<int>(std::ceil(kPointsPerDecade * std::log10(sharp / flat)));
  const double step = std::log(flat / sharp) / (points - 1);
  const auto grid = [&](int k) { return k == 0 ? sharp : sharp * std::exp(step * k); };

  // The largest exponent with ESS >= wanted, if the grid has one.
  const auto largest_reaching = [&](double wanted) -> Tempering {
    double above = sharp;
    double ess_above = curve.At(sharp);
    if (ess_above >= wanted) return {.exponent = sharp, .ess = ess_above, .reached = true};
    for (int k = 1; k < points; ++k) {
      const double below = grid(k);
      const double ess = curve.At(below);
      if (ess >= wanted) {
        const auto excess = [&](double log_exponent) {
          return curve.At(std::exp(log_exponent)) - wanted;
        };
        std::uintmax_t evaluations = kMostSteps;
        const auto close = [](double a, double b) {
          return std::abs(a - b) < kRootTolerance * (1 + std::abs(a));
        };
        const auto [low, high] = ess == wanted
                                     ? std::pair(std::log(below), std::log(below))
                                     : boost::math::tools::toms748_solve(
                                           excess, std::log(below), std::log(above), ess - wanted,
                                           ess_above - wanted, close, evaluations);
        const double exponent = std::exp(0.5 * (low + high));
        return {.exponent = exponent, .ess = curve.At(exponent), .reached = true};
      }
      above = below;
      ess_above = ess;
    }
    return {};
  };

  if (Tempering found = largest_reaching(problem.target); found.reached) {
    if (found.exponent == sharp && std::isfinite(problem.max_exponent))
      found.exponent = problem.max_exponent;
    return found;
  }

  // Out of reach: the highest hump in the interior of the grid.
  int highest = 0;
  double ess_highest = -1;
  for (int k = 0; k < points; ++k) {
    const double ess = curve.At(grid(k));
    if (ess > ess_highest) {
      ess_highest = ess;
      highest = k;
    }
  }
  if (ess_highest > curve.AtZero() * (1 + kRises)) {
    // Golden section between the neighbours of the highest grid point.
    double low = std::log(grid(std::min(highest + 1, points - 1)));
    double high = std::log(grid(std::max(highest - 1, 0)));
    while (high - low > kHumpTolerance) {
      const double left = high - kGolden * (high - low);
      const double right = low + kGolden * (high - low);
      if (curve.At(std::exp(left)) < curve.At(std::exp(right))) {
        low = left;
      } else {
        high = right;
      }
    }
    const double exponent = std::min(std::exp(0.5 * (low + high)), sharp);
    return {.exponent = exponent, .ess = curve.At(exponent), .reached = false};
  }
  const auto counted_share = problem.target / static_cast<double>(problem.log_start.size());
  Tempering relative = largest_reaching(counted_share * curve.AtZero());
  if (!relative.reached) relative = {.exponent = flat, .ess = curve.At(flat)};
  relative.reached = false;
  return relative;
}

}  // namespace calib::inference
