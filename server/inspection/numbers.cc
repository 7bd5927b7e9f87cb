#include "server/inspection/numbers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"

namespace calib::inspection {

Extent ExtentOf(const std::vector<double>& values) {
  Extent extent;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    if (extent.count++ == 0) extent.first = extent.min = extent.max = v;
    extent.min = std::min(extent.min, v);
    extent.max = std::max(extent.max, v);
    extent.last = v;
  }
  extent.largest = std::max(std::abs(extent.min), std::abs(extent.max));
  return extent;
}

bool IsWhole(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(),
                     [](double v) { return std::isnan(v) || v == std::floor(v); });
}

bool NeverFalls(const std::vector<double>& values) {
  double last = -std::numeric_limits<double>::infinity();
  for (const double v : values) {
    if (std::isnan(v)) continue;
    if (v < last) return false;
    last = v;
  }
  return true;
}

Line LineThrough(const std::vector<double>& x, const std::vector<double>& y) {
  Line line;
  double mx = 0, my = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    mx += x[i];
    my += y[i];
    ++line.count;
  }
  if (line.count < 2) return line;
  const auto n = static_cast<double>(line.count);
  mx /= n;
  my /= n;
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    xx += (x[i] - mx) * (x[i] - mx);
    xy += (x[i] - mx) * (y[i] - my);
  }
  if (!(xx > 0)) return line;
  line.slope = xy / xx;
  line.at_zero = my - line.slope * mx;
  double left = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    const double r = y[i] - line.at_zero - line.slope * x[i];
    left += r * r / n;
  }
  const double range = ExtentOf(y).range();
  line.left = range > 0 ? std::sqrt(left) / range : std::numeric_limits<double>::infinity();
  return line;
}

double Apart(const std::vector<double>& a, const std::vector<double>& b) {
  double apart = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) {
    if (std::isnan(a[i]) || std::isnan(b[i])) continue;
    apart = std::max(apart, std::abs(a[i] - b[i]));
    ++count;
  }
  const double range = ExtentOf(a).range();
  if (count < 3 || !(range > 0)) return std::numeric_limits<double>::infinity();
  return apart / range;
}

std::string Short(double value) { return absl::StrFormat("%.4g", value); }

}  // namespace calib::inspection
