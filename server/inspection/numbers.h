#pragma once
// Small things asked of columns of numbers; NaN is a missing reading and left out.

#include <cstddef>
#include <string>
#include <vector>

namespace calib::inspection {

struct Extent {
  std::size_t count = 0;
  double min = 0, max = 0, first = 0, last = 0;
  double largest = 0;  ///< size
  [[nodiscard]] double range() const { return max - min; }
};
Extent ExtentOf(const std::vector<double>& values);

bool IsWhole(const std::vector<double>& values);
bool NeverFalls(const std::vector<double>& values);

/// y = at_zero + slope x by least squares.
struct Line {
  double slope = 0, at_zero = 0;
  double left = 0;  ///< rms of what it leaves over the range of y [-]
  std::size_t count = 0;
};
Line LineThrough(const std::vector<double>& x, const std::vector<double>& y);

/// Largest |a - b| over the range of a [-]; infinite where nothing can be compared.
double Apart(const std::vector<double>& a, const std::vector<double>& b);

/// Four digits.
std::string Short(double value);

}  // namespace calib::inspection
