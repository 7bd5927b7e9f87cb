#include "server/inspection/series.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calib::inspection {
namespace {

constexpr double kNormalMedian = 1.4826;  // sd over median of sizes of a normal variable
constexpr std::size_t kLeastOfNoise = 5;
constexpr std::size_t kLeastOfBranch = 10;
constexpr std::size_t kMostOrder = 4;  // of differences; higher ones need closer readings
// Fall of a stress over its noise that is no noise [-]: of 1e4 normal readings none in 1e4 files,
// and where the control stands still, which it does for a reason.
constexpr double kDrop = 6;
constexpr double kDropAtRest = 3;
constexpr double kLeastDrop = 1e-3;     // of the range: less is not seen in a picture
constexpr double kSeldom = 0.05;        // of all steps
constexpr double kStandsStill = 0.02;   // of the usual step of the control
constexpr std::size_t kLongestDip = 3;  // readings. Chosen: a pause is logged once or twice
// Fewest steps within the range from which on rounding is not spoken of.
constexpr double kFineSteps = 1000;
constexpr double kShareOfBranch = 0.1;  // of a branch that one local fit looks at, to each side

double MedianOf(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct Points {
  std::vector<double> x, y;
  std::vector<std::size_t> at;
};

// Branches between turning points, without missing readings.
std::vector<Points> BranchesOf(const Curve& curve) {
  std::vector<Points> branches(1);
  std::size_t next = 0;
  for (std::size_t i = 0; i < curve.values.size(); ++i) {
    if (next < curve.turning.size() && i > curve.turning[next]) {
      ++next;
      branches.emplace_back();
    }
    if (std::isnan(curve.values[i]) || std::isnan(curve.control[i])) continue;
    branches.back().x.push_back(curve.control[i]);
    branches.back().y.push_back(curve.values[i]);
    branches.back().at.push_back(i);
  }
  return branches;
}

// Value at x0 of the parabola fitted to points [from, to), weights falling to the ends (tricube).
double LocalParabola(const Points& points, std::size_t from, std::size_t to, double x0) {
  double reach = 0;
  for (std::size_t i = from; i < to; ++i) reach = std::max(reach, std::abs(points.x[i] - x0));
  if (!(reach > 0)) reach = 1;
  double s[5] = {0, 0, 0, 0, 0};
  double t[3] = {0, 0, 0};
  for (std::size_t i = from; i < to; ++i) {
    const double u = (points.x[i] - x0) / reach;
    const double a = std::abs(u) * std::abs(u) * std::abs(u);
    const double w = std::pow(std::max(1 - a, 0.0), 3) + 1e-3;  // none is left out altogether
    double power = w;
    for (int k = 0; k < 5; ++k, power *= u) s[k] += power;
    t[0] += w * points.y[i];
    t[1] += w * u * points.y[i];
    t[2] += w * u * u * points.y[i];
  }
  // Cramer's rule for the constant; a line or a mean where the points are too few or in one place.
  const double det = s[0] * (s[2] * s[4] - s[3] * s[3]) - s[1] * (s[1] * s[4] - s[3] * s[2]) +
                     s[2] * (s[1] * s[3] - s[2] * s[2]);
  constexpr double kSingular = 1e-10;
  if (std::abs(det) < kSingular * s[0] * s[0] * s[0]) return t[0] / s[0];
  return (t[0] * (s[2] * s[4] - s[3] * s[3]) - s[1] * (t[1] * s[4] - s[3] * t[2]) +
          s[2] * (t[1] * s[3] - s[2] * t[2])) /
         det;
}

// What a smooth curve leaves of a branch; fits stand at knots and are joined by lines.
std::vector<double> LeftOf(const Points& points) {
  const std::size_t n = points.y.size();
  const auto half =
      std::max<std::size_t>(4, static_cast<std::size_t>(kShareOfBranch * static_cast<double>(n)));
  const std::size_t stride = std::max<std::size_t>(1, half / 8);
  std::vector<std::size_t> knots;
  for (std::size_t i = 0; i < n; i += stride) knots.push_back(i);
  if (knots.back() + 1 != n) knots.push_back(n - 1);
  std::vector<double> fitted;
  for (const std::size_t knot : knots) {
    const std::size_t from = knot > half ? knot - half : 0;
    fitted.push_back(LocalParabola(points, from, std::min(n, knot + half + 1), points.x[knot]));
  }
  std::vector<double> left(n);
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const double span = points.x[knots[k + 1]] - points.x[knots[k]];
    for (std::size_t i = knots[k]; i <= knots[k + 1]; ++i) {
      const double share = span != 0 ? (points.x[i] - points.x[knots[k]]) / span
                                     : static_cast<double>(i - knots[k]) /
                                           static_cast<double>(knots[k + 1] - knots[k]);
      left[i] = points.y[i] - (fitted[k] + share * (fitted[k + 1] - fitted[k]));
    }
  }
  return left;
}

// Sum of autocorrelations over all lags, 1 for white noise [Geyer 1992, initial positive sequence].
double CorrelationTime(const std::vector<double>& left) {
  const std::size_t n = left.size();
  double mean = 0;
  for (const double r : left) mean += r / static_cast<double>(n);
  const auto lag = [&](std::size_t k) {
    double sum = 0;
    for (std::size_t i = k; i < n; ++i) sum += (left[i] - mean) * (left[i - k] - mean);
    return sum / static_cast<double>(n);
  };
  const double variance = lag(0);
  if (!(variance > 0)) return 1;
  double sum = 0;
  const std::size_t most = std::min<std::size_t>(n, 2000);
  for (std::size_t k = 0; k + 1 < most; k += 2) {
    const double pair = (lag(k) + lag(k + 1)) / variance;
    if (pair <= 0) break;
    sum += pair;
  }
  return std::max(1.0, 2 * sum - 1);
}

// Contrast of order + 1 neighbours that a polynomial of degree order - 1 has none of, for errors of
// sd 1 of sd 1: the divided difference, its weights normed. Readings at one control count as
// equally far apart.
double Difference(const Points& points, std::size_t from, std::size_t order) {
  bool apart = true;
  for (std::size_t j = 0; j < order; ++j) {
    apart = apart && points.x[from + j] != points.x[from + j + 1];
  }
  double sum = 0;
  double norm = 0;
  for (std::size_t j = 0; j <= order; ++j) {
    double weight = 1;
    for (std::size_t m = 0; m <= order; ++m) {
      if (m == j) continue;
      weight /= apart ? (points.x[from + j] - points.x[from + m]) /
                            (points.x[from + order] - points.x[from])
                      : static_cast<double>(j) - static_cast<double>(m);
    }
    sum += weight * points.y[from + j];
    norm += weight * weight;
  }
  return std::isfinite(norm) && norm > 0 ? sum / std::sqrt(norm) : 0;
}

}  // namespace

std::optional<double> QuantumOf(const std::vector<double>& values) {
  std::vector<double> sorted;
  for (const double v : values) {
    if (!std::isnan(v)) sorted.push_back(v);
  }
  if (sorted.size() < kLeastOfNoise) return std::nullopt;
  std::sort(sorted.begin(), sorted.end());
  const double range = sorted.back() - sorted.front();
  if (!(range > 0)) return std::nullopt;
  const double least = range / kFineSteps;
  double step = range;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double gap = sorted[i] - sorted[i - 1];
    if (gap > least * 1e-3) step = std::min(step, gap);
  }
  if (step < least) return std::nullopt;
  constexpr double kOffGrid = 0.05;  // of a step: numbers are themselves written with few digits
  for (const double v : sorted) {
    const double steps = (v - sorted.front()) / step;
    if (std::abs(steps - std::round(steps)) > kOffGrid) return std::nullopt;
  }
  return step;
}

double NoiseOf(const Curve& curve) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t order = 2; order <= kMostOrder; ++order) {
    std::vector<double> sizes;
    for (const Points& points : BranchesOf(curve)) {
      for (std::size_t i = 0; i + order < points.y.size(); ++i) {
        sizes.push_back(std::abs(Difference(points, i, order)));
      }
    }
    if (sizes.size() + order < kLeastOfNoise) continue;
    least = std::min(least, kNormalMedian * MedianOf(std::move(sizes)));
  }
  if (!std::isfinite(least)) return std::numeric_limits<double>::quiet_NaN();
  return std::max(least, QuantumOf(curve.values).value_or(0) / std::sqrt(12.0));
}

double IndependentReadings(const Curve& curve) {
  double independent = 0;
  double all = 0;
  for (const Points& points : BranchesOf(curve)) {
    const auto n = static_cast<double>(points.y.size());
    all += n;
    independent +=
        points.y.size() < kLeastOfBranch ? n : std::max(1.0, n / CorrelationTime(LeftOf(points)));
  }
  return std::max(1.0, std::min(all, independent));
}

std::vector<std::size_t> DipsOf(const Curve& curve, double noise) {
  std::vector<std::size_t> dips;
  const double least = std::max(noise, QuantumOf(curve.values).value_or(0));
  if (!(least > 0)) return dips;
  for (const Points& points : BranchesOf(curve)) {
    const std::size_t n = points.y.size();
    std::vector<double> steps;
    steps.reserve(n);
    for (std::size_t i = 1; i < n; ++i) steps.push_back(std::abs(points.x[i] - points.x[i - 1]));
    const double range = n > 0 ? *std::max_element(points.y.begin(), points.y.end()) -
                                     *std::min_element(points.y.begin(), points.y.end())
                               : 0;
    const double still = kStandsStill * MedianOf(steps);
    const auto stands = static_cast<double>(
        std::count_if(steps.begin(), steps.end(), [still](double step) { return step <= still; }));
    // Where many readings share a control it is coarse, and does not rest.
    const bool rests = stands <= kSeldom * static_cast<double>(steps.size());
    for (std::size_t i = 2; i + 1 < n; ++i) {
      const double before = std::abs(points.y[i - 1]);
      const double drop = before - std::abs(points.y[i]);
      const double limit = rests && steps[i - 1] <= still ? kDropAtRest : kDrop;
      if (drop <= limit * least || drop <= kLeastDrop * range) continue;
      for (std::size_t k = i + 1; k < n && k <= i + kLongestDip; ++k) {
        // What goes through zero and grows again has turned, not paused.
        if (points.y[k] * points.y[i - 1] < 0 || std::abs(points.y[k]) < before) continue;
        dips.push_back(points.at[i]);
        i = k;
        break;
      }
    }
  }
  return dips;
}

}  // namespace calib::inspection
