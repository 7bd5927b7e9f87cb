#include "inference/diagnosis/drawn_tail.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <map>

#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Nodes of the integral over Student's law: ten per decade of either tail, of the upper one down to
// 1e-9, beyond which no p value means anything; the test DrawnTail.OfGroupsFarApartIsStudents of
// inference_diagnosis_unit_test holds the law so integrated against Student's own.
constexpr int kPerDecade = 10;
constexpr int kDecadesBelow = 2;
constexpr int kDecadesAbove = 9;
// Where the gamma law's tail is 0 or 1 without being evaluated: beyond e^-740 by Chernoff's bound
// of either tail, which is less than a double holds; and by so large a shape that it is a step,
// whose series would not end.
constexpr double kNothing = 740;
constexpr double kNarrow = 1e9;

double GammaTail(double mean, double variance, double square) {
  const double shape = mean * mean / variance;
  const double ratio = square / mean;
  if (shape > kNarrow || !(shape * (ratio - 1 - std::log(ratio)) < kNothing)) {
    return ratio > 1 ? 0 : 1;
  }
  return GammaQ(shape, shape * ratio);
}

double Variance(const Eigen::ArrayXd& values) {
  return (values - values.mean()).square().sum() / static_cast<double>(values.size() - 1);
}

}  // namespace

DrawnTail::DrawnTail(const Eigen::VectorXd& drawn, const std::vector<int>& group, int freedom)
    : mean_(drawn.mean()), variance_(Variance(drawn)), freedom_(freedom) {
  assert(freedom >= 0 && (freedom == 0 || group.empty()));
  assert(group.empty() || static_cast<Index>(group.size()) == drawn.size());
  std::map<int, std::vector<Index>> rows;
  for (std::size_t i = 0; i < group.size(); ++i) rows[group[i]].push_back(static_cast<Index>(i));
  if (rows.size() < 2 || !varies()) return;
  Eigen::ArrayXd logarithm(static_cast<Index>(rows.size()));
  double chance = 0;  // of the logarithms, since a group's draws are not all there could be
  Index g = 0;
  for (const auto& [number, own] : rows) {
    const Eigen::ArrayXd squares = drawn(own);
    logarithm[g++] = std::log(squares.mean());
    if (own.size() < 2) continue;
    const double relative = Variance(squares) / (squares.mean() * squares.mean());
    within_ += relative / static_cast<double>(rows.size());
    chance += relative / static_cast<double>(own.size() * rows.size());
  }
  const double between = Variance(logarithm) - chance;
  if (!(between > 0) || !(within_ > 0)) return;
  const auto groups = static_cast<double>(rows.size());
  const double width = std::sqrt(between * (1 + 1 / groups));
  const StudentLaw law{.freedom = groups - 1};
  const auto add_side = [&](double sign, int decades) {
    double beyond = 0.5;
    for (int k = 1; k <= kPerDecade * decades; ++k) {
      const bool last = k == kPerDecade * decades;
      const double next = last ? 0 : 0.5 * std::pow(10.0, -static_cast<double>(k) / kPerDecade);
      const double t = law.TailQuantile(0.5 * (beyond + next));
      means_.emplace_back(std::exp(logarithm.mean() + sign * width * t), beyond - next);
      beyond = next;
    }
  };
  add_side(-1, kDecadesBelow);
  add_side(1, kDecadesAbove);
}

double DrawnTail::operator()(double square) const {
  if (!varies()) return 1;
  if (freedom_ > 0) {
    const FisherLaw law{.numerator = 2 * mean_ * mean_ / variance_,
                        .denominator = static_cast<double>(freedom_)};
    return law.Tail(square / mean_);
  }
  if (means_.empty()) return GammaTail(mean_, variance_, square);
  double sum = 0;
  for (const auto& [mean, weight] : means_) {
    const double variance = within_ * mean * mean;
    if (!(variance > 0)) continue;  // so small a mean that no square is smaller
    sum += weight * (std::isfinite(variance) ? GammaTail(mean, variance, square) : 1);
  }
  return std::min(1.0, sum);
}

}  // namespace calib::inference
