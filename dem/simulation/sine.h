#pragma once
// Sine and cosine that give the same bits on every processor, for motions that are prescribed.

#include <cmath>

namespace calib::dem {

/// sin(x) for |x| below about 1e6, within 1e-12: reduced to a half turn about zero, then the Taylor
/// series; + - * / and rounding only, where libm chooses its code by processor.
inline double Sine(double x) {
  constexpr double kPi = 3.141592653589793;
  const double turns = std::floor(x / (2 * kPi) + 0.5);
  const double t = x - turns * (2 * kPi);
  double sum = 1.0;
  for (int n = 27; n >= 3; n -= 2) {
    sum = 1.0 - t * t / ((n - 1) * n) * sum;
  }
  return t * sum;
}

inline double Cosine(double x) { return Sine(x + 1.5707963267948966); }

}  // namespace calib::dem
