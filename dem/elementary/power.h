#pragma once
// Powers with real exponents that give the same bits on every processor.

#include <bit>
#include <cstdint>

namespace calib::dem {

/// x^y for x > 0 (normal numbers), within about 1e-14 relative while |y log2 x| < 1000, beyond
/// which it saturates; exactly 1 for y = 0. libm chooses its code by processor, so that its last
/// bit may differ; this is + - * / and bit patterns only: 2^(y log2 x) with the series of artanh
/// for the logarithm and of exp for the fraction of the exponent, both to rounding.
inline double Power(double x, double y) {
  const auto bits = std::bit_cast<std::uint64_t>(x);
  auto exponent = static_cast<double>(static_cast<int>(bits >> 52U) - 1023);
  double mantissa = std::bit_cast<double>((bits & 0x000FFFFFFFFFFFFFULL) | 0x3FF0000000000000ULL);
  const bool high = mantissa > 1.4142135623730951;
  mantissa = high ? 0.5 * mantissa : mantissa;
  exponent = high ? exponent + 1.0 : exponent;
  const double t = (mantissa - 1.0) / (mantissa + 1.0);
  const double t2 = t * t;
  double series = 1.0 / 21.0;
  for (int n = 19; n >= 1; n -= 2) {
    series = series * t2 + 1.0 / n;
  }
  constexpr double kTwoOverLn2 = 2.8853900817779268;  // 2/ln 2
  double power = y * (exponent + kTwoOverLn2 * t * series);
  power = power > 1000.0 ? 1000.0 : power;
  power = power < -1000.0 ? -1000.0 : power;
  constexpr double kRound = 6755399441055744.0;  // 1.5 2^52: adding it rounds to an integer
  const double shifted = power + kRound;
  const double f = (power - (shifted - kRound)) * 0.69314718055994531;
  double e = 1.0;
  for (int n = 14; n >= 1; --n) {
    e = 1.0 + e * f / n;
  }
  // An int, which vectors convert: 23 .. 2023 after the shift.
  // NOLINTNEXTLINE(bugprone-misplaced-widening-cast)
  const auto whole = static_cast<std::uint64_t>(static_cast<int>(shifted - kRound) + 1023);
  return e * std::bit_cast<double>(whole << 52U);
}

}  // namespace calib::dem
