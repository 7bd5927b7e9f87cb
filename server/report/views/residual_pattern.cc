#include "server/report/views/residual_pattern.h"

#include <algorithm>
#include <array>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "server/campaign/model/word_table.h"

namespace calib::report {
namespace {

using Eigen::Index;

constexpr std::array kShapeWords = {
    campaign::Word{ResidualShape::kNone, "none"},
    campaign::Word{ResidualShape::kOffset, "offset"},
    campaign::Word{ResidualShape::kSlope, "slope"},
    campaign::Word{ResidualShape::kAmplitude, "amplitude"},
    campaign::Word{ResidualShape::kLag, "lag"},
    campaign::Word{ResidualShape::kIrregular, "irregular"},
};

constexpr double kFits = 0.01;  // p of chi-squared above which there is nothing to name
constexpr double kMostOfIt = 0.5;
constexpr double kAsGood = 0.95;  // of the best: an earlier, simpler shape is preferred

// Central differences; repeated controls take the step beyond them.
Eigen::VectorXd Derivative(const Eigen::VectorXd& y, const Eigen::VectorXd& x) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(y.size());
  for (Index i = 0; i < y.size(); ++i) {
    const Index a = std::max<Index>(0, i - 1);
    const Index b = std::min<Index>(y.size() - 1, i + 1);
    if (x[b] != x[a]) slope[i] = (y[b] - y[a]) / (x[b] - x[a]);
  }
  return slope;
}

}  // namespace

const char* ToString(ResidualShape shape) { return campaign::WordOf(kShapeWords, shape); }

Eigen::VectorXd Whitened(const ResidualCurve& curve, const Eigen::VectorXd& x) {
  Eigen::VectorXd white = x.cwiseQuotient(curve.sd);
  for (Index i = white.size() - 1; i > 0; --i) {
    const double c = curve.correlation[i];
    white[i] = (white[i] - c * white[i - 1]) / std::sqrt(1 - c * c);
  }
  return white;
}

ResidualPattern PatternOf(const ResidualCurve& curve) {
  ResidualPattern pattern;
  const Index n = curve.residual.size();
  if (n < 3) return pattern;
  const Eigen::VectorXd r = Whitened(curve, curve.residual);
  const double chi2 = r.squaredNorm();
  const auto degrees = static_cast<double>(n);
  if (!std::isfinite(chi2) || boost::math::gamma_q(0.5 * degrees, 0.5 * chi2) > kFits) {
    return pattern;
  }
  const std::vector<std::pair<ResidualShape, Eigen::VectorXd>> shapes = {
      {ResidualShape::kOffset, Eigen::VectorXd::Ones(n)},
      {ResidualShape::kSlope, curve.control.array() - curve.control.mean()},
      {ResidualShape::kAmplitude, curve.model},
      {ResidualShape::kLag, -Derivative(curve.model, curve.control)}};
  pattern.shape = ResidualShape::kIrregular;
  double best = 0;
  for (const auto& [shape, curve_of_shape] : shapes) {
    const Eigen::VectorXd f = Whitened(curve, curve_of_shape);
    const double square = f.squaredNorm();
    if (!(square > 0) || !std::isfinite(square)) continue;
    const double along = f.dot(r);
    const double gain = along * along / square;
    const double explained = std::min(1.0, gain / (chi2 - degrees));
    const double z = along / std::sqrt(square);
    if (explained < kMostOfIt || std::abs(z) < kClear || kAsGood * gain < best) continue;
    best = gain;
    pattern = {.shape = shape, .size = along / square, .z = z, .explained = explained};
  }
  return pattern;
}

}  // namespace calib::report
