#include "inference/prior/prior.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/standard_normal.h"

namespace calib::inference {
namespace {

// Variance of a truncated normal over the square of what it is a difference of, below which half of
// the digits have cancelled.
constexpr double kCancelled = 1e-8;
// Distance between the quartiles of the standard normal.
constexpr double kQuartileRange = 1.3489795003921634;
// Strips of the midpoint rule for a standard deviation; chosen. It is low by less than 2e-5 of
// itself where both ends are cut off (six decades of a log-uniform, sd of ln x up to 2 of a
// log-normal). Of a log-normal cut off at the low end alone it misses part of the upper tail: low
// by 0.2, 2 and 26 % at sd of ln x of 0.5, 1 and 2.
constexpr int kStrips = 2048;

bool IsLog(PriorKind kind) {
  return kind == PriorKind::kLogUniform || kind == PriorKind::kLogNormal;
}
bool IsNormal(PriorKind kind) {
  return kind == PriorKind::kNormal || kind == PriorKind::kLogNormal;
}

// The coordinate in which the prior is uniform or normal: ln x for the log kinds.
double ToPlain(const Prior& prior, double x) { return IsLog(prior.kind) ? std::log(x) : x; }
double FromPlain(const Prior& prior, double t) { return IsLog(prior.kind) ? std::exp(t) : t; }

struct Interval {
  double low, high;
};

// Bounds of the plain coordinate; a log-normal without a lower bound begins at x = 0, t = -inf.
Interval PlainBounds(const Prior& prior) {
  if (!IsLog(prior.kind)) return {prior.min, prior.max};
  return {prior.min > 0 ? std::log(prior.min) : -kInfinity, std::log(prior.max)};
}

// Bounds of (t - mean) / sd for the normal kinds.
Interval NormalBounds(const Prior& prior) {
  const Interval plain = PlainBounds(prior);
  return {(plain.low - prior.mean) / prior.sd, (plain.high - prior.mean) / prior.sd};
}

struct Scaling {
  double centre, width;
};

// Mean and standard deviation of the plain coordinate.
Scaling PlainScaling(const Prior& prior) {
  if (!IsNormal(prior.kind)) {
    const auto [low, high] = PlainBounds(prior);
    return {0.5 * (low + high), (high - low) / std::sqrt(12.0)};
  }
  const auto [a, b] = NormalBounds(prior);
  if (a == -kInfinity && b == kInfinity) return {prior.mean, prior.sd};
  // Moments of a truncated normal [Johnson, Kotz & Balakrishnan 1994, sec. 13.10].
  const double log_mass = LogNormalMass(a, b);
  const double at_a = std::isinf(a) ? 0 : std::exp(LogNormalDensity(a) - log_mass);
  const double at_b = std::isinf(b) ? 0 : std::exp(LogNormalDensity(b) - log_mass);
  const double shift = at_a - at_b;
  const double second = 1 + (std::isinf(a) ? 0 : a * at_a) - (std::isinf(b) ? 0 : b * at_b);
  const double variance = second - shift * shift;
  if (variance > kCancelled * (1 + shift * shift)) {
    return {prior.mean + prior.sd * shift, prior.sd * std::sqrt(variance)};
  }
  const double lower = ToPlain(prior, prior.Quantile(0.25));
  const double upper = ToPlain(prior, prior.Quantile(0.75));
  return {0.5 * (lower + upper), (upper - lower) / kQuartileRange};
}

}  // namespace

absl::Status Prior::Validate() const {
  if (std::isnan(min) || std::isnan(max) || min >= max) {
    return absl::InvalidArgumentError(
        absl::StrCat("the prior's min ", min, " is not below its max ", max, "."));
  }
  if (kind == PriorKind::kLogUniform && !(min > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("a log-uniform prior needs min > 0; it is ", min, "."));
  }
  if (kind == PriorKind::kLogNormal && !(max > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("a log-normal prior needs max > 0; it is ", max, "."));
  }
  if (!IsNormal(kind)) {
    if (std::isfinite(min) && std::isfinite(max)) return absl::OkStatus();
    return absl::InvalidArgumentError("a uniform prior needs finite min and max.");
  }
  if (!std::isfinite(mean) || !std::isfinite(sd) || !(sd > 0)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a normal prior needs a finite mean and sd > 0; they are ", mean, " and ", sd, "."));
  }
  const auto [a, b] = NormalBounds(*this);
  if (!std::isfinite(LogNormalMass(a, b))) {
    return absl::InvalidArgumentError(absl::StrCat("the prior has no mass between its bounds ", min,
                                                   " and ", max,
                                                   ": they lie too far from its mean."));
  }
  return absl::OkStatus();
}

double Prior::MassBetweenBounds() const {
  if (!IsNormal(kind)) return 1;
  const auto [a, b] = NormalBounds(*this);
  return std::exp(LogNormalMass(a, b));
}

bool Prior::InSupport(double x) const {
  if (kind == PriorKind::kLogNormal && !(x > 0)) return false;
  return x >= min && x <= max && std::isfinite(x);
}

double Prior::LogDensity(double x) const {
  if (!InSupport(x)) return -kInfinity;
  const double log_slope = IsLog(kind) ? -std::log(x) : 0;  // dt/dx = 1/x
  if (!IsNormal(kind)) {
    const auto [low, high] = PlainBounds(*this);
    return log_slope - std::log(high - low);
  }
  const auto [a, b] = NormalBounds(*this);
  const double z = (ToPlain(*this, x) - mean) / sd;
  return log_slope + LogNormalDensity(z) - std::log(sd) - LogNormalMass(a, b);
}

double Prior::Quantile(double u) const {
  assert(u > 0 && u < 1);
  if (!IsNormal(kind)) {
    const auto [low, high] = PlainBounds(*this);
    return std::clamp(FromPlain(*this, low + u * (high - low)), min, max);
  }
  // Phi(z) = (1 - u) Phi(a) + u Phi(b), and so of the upper tail: sums of positive terms, no
  // cancellation. The smaller of the two probabilities is inverted, in log space.
  const auto [a, b] = NormalBounds(*this);
  const auto mix = [u](double log_at_a, double log_at_b) {
    const double first = std::log1p(-u) + log_at_a;
    const double second = std::log(u) + log_at_b;
    const double larger = std::max(first, second);
    return larger + std::log1p(std::exp(std::min(first, second) - larger));
  };
  const double log_lower = mix(LogNormalCdf(a), LogNormalCdf(b));
  const double log_upper = mix(LogNormalCdf(-a), LogNormalCdf(-b));
  const double z =
      log_lower < log_upper ? NormalQuantileFromLog(log_lower) : -NormalQuantileFromLog(log_upper);
  return std::clamp(FromPlain(*this, mean + sd * std::clamp(z, a, b)), min, max);
}

double Prior::NormalScore(double x) const {
  double log_lower = 0;
  double log_upper = 0;
  if (!IsNormal(kind)) {
    const auto [low, high] = PlainBounds(*this);
    const double t = std::clamp(ToPlain(*this, x), low, high);
    log_lower = std::log((t - low) / (high - low));
    log_upper = std::log((high - t) / (high - low));
  } else {
    const auto [a, b] = NormalBounds(*this);
    const double z = std::clamp((ToPlain(*this, x) - mean) / sd, a, b);
    if (a == -kInfinity && b == kInfinity) return z;
    const double log_mass = LogNormalMass(a, b);
    log_lower = std::min(0.0, LogNormalMass(a, z) - log_mass);
    log_upper = std::min(0.0, LogNormalMass(z, b) - log_mass);
  }
  return log_lower < log_upper ? NormalQuantileFromLog(log_lower)
                               : -NormalQuantileFromLog(log_upper);
}

double Prior::FromNormalScore(double z) const {
  if (IsNormal(kind)) {
    const auto [a, b] = NormalBounds(*this);
    if (a == -kInfinity && b == kInfinity) return FromPlain(*this, mean + sd * z);
  }
  // The nearest numbers to 0 and 1 that Quantile takes.
  constexpr double kLeast = std::numeric_limits<double>::min();
  constexpr double kMost = 1 - 0x1p-53;
  return Quantile(std::clamp(std::exp(LogNormalCdf(z)), kLeast, kMost));
}

double Prior::StandardDeviation() const {
  if (!IsLog(kind)) return PlainScaling(*this).width;
  if (IsNormal(kind)) {
    const auto [a, b] = NormalBounds(*this);
    if (a == -kInfinity && b == kInfinity) {
      return std::exp(mean + 0.5 * sd * sd) * std::sqrt(std::expm1(sd * sd));
    }
  }
  // Midpoint rule over equally probable strips.
  double sum = 0;
  double sum_of_squares = 0;
  const double reference = Quantile(0.5);
  for (int i = 0; i < kStrips; ++i) {
    const double difference = Quantile((i + 0.5) / kStrips) - reference;
    sum += difference;
    sum_of_squares += difference * difference;
  }
  const double shift = sum / kStrips;
  return std::sqrt(sum_of_squares / kStrips - shift * shift);
}

double Prior::ToStandard(double x) const {
  const auto [centre, width] = PlainScaling(*this);
  return (ToPlain(*this, x) - centre) / width;
}

double Prior::FromStandard(double s) const {
  const auto [centre, width] = PlainScaling(*this);
  return FromPlain(*this, centre + width * s);
}

double Prior::LogJacobian(double x) const {
  return -std::log(PlainScaling(*this).width) - (IsLog(kind) ? std::log(x) : 0);
}

}  // namespace calib::inference
