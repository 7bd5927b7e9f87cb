#include "inference/mixture/box_probability.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "inference/numerics/standard_normal.h"
#include "inference/sampling/halton.h"

namespace calib::inference {
namespace {

constexpr int kPoints = 4096;  // of the sequence; the error they leave stands in the header

}  // namespace

double BoxProbability(const Eigen::MatrixXd& cholesky, const Eigen::VectorXd& low,
                      const Eigen::VectorXd& high) {
  const Eigen::Index d = low.size();
  assert(cholesky.rows() == d && high.size() == d);
  const bool diagonal = d == 1 || cholesky.isDiagonal(0.0);
  const int points = diagonal ? 1 : kPoints;
  const Eigen::MatrixXd uniforms = Halton(points, static_cast<int>(d - 1));
  double sum = 0;
  Eigen::VectorXd z(d);
  for (int i = 0; i < points; ++i) {
    double mass = 1;
    for (Eigen::Index k = 0; k < d && mass > 0; ++k) {
      double shift = 0;
      for (Eigen::Index l = 0; l < k; ++l) shift += cholesky(k, l) * z[l];
      const double a = (low[k] - shift) / cholesky(k, k);
      const double b = (high[k] - shift) / cholesky(k, k);
      const double inside = std::exp(LogNormalMass(a, b));
      if (inside > 0 && k + 1 < d) {
        // Inverted in the tail that keeps its digits.
        const double u = uniforms(i, k);
        const bool upper = a > 0;
        const double start = std::exp(LogNormalCdf(upper ? -b : a));
        const double within = start + (upper ? 1 - u : u) * inside;
        const double quantile =
            within > 0 && within < 1 ? NormalQuantile(within) : (upper ? -b : a);
        z[k] = std::clamp(upper ? -quantile : quantile, a, b);
      }
      mass *= inside;
    }
    sum += mass;
  }
  return std::min(sum / points, 1.0);
}

}  // namespace calib::inference
