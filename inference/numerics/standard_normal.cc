#include "inference/numerics/standard_normal.h"

#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <numbers>

#include "inference/numerics/infinity.h"

namespace calib::inference {
namespace {

const double kLogSqrtTwoPi = 0.5 * std::log(2 * std::numbers::pi);
constexpr double kLeastOfErfc = -37;  // x where erfc(-x / sqrt 2) / 2 nears the least normal number
// Width of an interval (times 1 + |its middle|) below which the next term of its mass, relative to
// the two that are taken, is below 1e-15.
constexpr double kNarrow = 1e-3;
constexpr double kLeastOfExp = -700;  // ln p where p nears the least normal number
constexpr int kNewtonSteps = 4;       // each doubles the digits; the start has two

// double throughout: long double would give other bits on other machines.
using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

// Phi(x) for x <= 0.
double LowerTail(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

// The quantile of p <= 1/2 that does not underflow.
double LowerQuantile(double p) {
  return -std::numbers::sqrt2 * boost::math::erfc_inv(2 * p, Policy());
}

}  // namespace

double LogNormalDensity(double x) { return -0.5 * x * x - kLogSqrtTwoPi; }

double LogNormalCdf(double x) {
  if (x > 0) return std::log1p(-LowerTail(-x));
  if (x > kLeastOfErfc) return std::log(LowerTail(x));
  if (x == -kInfinity) return -kInfinity;
  const double q = 1 / (x * x);
  const double series = -q * (1 - 3 * q * (1 - 5 * q * (1 - 7 * q * (1 - 9 * q * (1 - 11 * q)))));
  return LogNormalDensity(x) - std::log(-x) + std::log1p(series);
}

double LogNormalMass(double a, double b) {
  if (!(a < b)) return -kInfinity;
  const double middle = 0.5 * (a + b);
  const double width = b - a;
  if (std::isfinite(width) && width * (1 + std::abs(middle)) < kNarrow) {
    // phi(m) (w + (m^2 - 1) w^3 / 24)
    return LogNormalDensity(middle) + std::log(width) +
           std::log1p((middle * middle - 1) * width * width / 24);
  }
  if (a > 0) return LogNormalMass(-b, -a);
  const double upper = LogNormalCdf(b);
  if (b <= 0) return upper + std::log1p(-std::exp(LogNormalCdf(a) - upper));
  return std::log1p(-LowerTail(a) - LowerTail(-b));  // a <= 0 < b
}

double NormalQuantileFromLog(double log_p) {
  if (log_p > -std::numbers::ln2) return -LowerQuantile(-std::expm1(log_p));
  if (log_p > kLeastOfExp) return LowerQuantile(std::exp(log_p));
  if (log_p == -kInfinity) return -kInfinity;
  // Newton on ln Phi(x) = log_p, whose slope is phi/Phi; ln Phi is concave, so the steps stay on
  // one side.
  double x = -std::sqrt(-2 * log_p - 2 * kLogSqrtTwoPi - std::log(-2 * log_p));
  for (int step = 0; step < kNewtonSteps; ++step) {
    const double log_cdf = LogNormalCdf(x);
    x -= (log_cdf - log_p) * std::exp(log_cdf - LogNormalDensity(x));
  }
  return x;
}

double NormalQuantile(double u) { return u <= 0.5 ? LowerQuantile(u) : -LowerQuantile(1 - u); }

}  // namespace calib::inference
