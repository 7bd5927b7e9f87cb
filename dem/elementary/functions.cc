#include "dem/elementary/functions.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace calib::dem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// ln 2 and pi/2 in parts: products of the leading ones with whole numbers below 2^20 are exact
// [fdlibm, e_log.c and e_rem_pio2.c].
constexpr double kLn2High = 6.93147180369123816490e-01;
constexpr double kLn2Low = 1.90821492927058770002e-10;
constexpr double kQuarter1 = 1.57079632673412561417e+00;
constexpr double kQuarter2 = 6.07710050630396597660e-11;
constexpr double kQuarter3 = 2.02226624871116645580e-21;
constexpr double kQuarter3Rest = 8.47842766036889956997e-32;

/// 2^k for -1022 <= k <= 1023.
double PowerOfTwo(int k) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(k + 1023) << 52U);
}

/// y 2^k for y in [0.5, 2), rounded once where it underflows.
double Scaled(double y, int k) {
  if (k > 1000) {
    return y * PowerOfTwo(k - 1000) * PowerOfTwo(1000);
  }
  return k < -1000 ? y * PowerOfTwo(k + 1000) * PowerOfTwo(-1000) : y * PowerOfTwo(k);
}

/// (e^r - 1) - r for |r| < 0.4: the rest of the Taylor series.
double ExpBeyondLinear(double r) {
  double sum = 1.0;
  for (int n = 16; n >= 3; --n) {
    sum = 1.0 + sum * r / n;
  }
  return 0.5 * r * r * sum;
}

/// A number near zero in two parts, and how many quarter turns lie before it.
struct Turned {
  double angle = 0, rest = 0;
  int quarter = 0;
};

Turned Reduced(double x) {
  if (!(std::abs(x) < 1e6)) {
    x = std::remainder(x, 2 * std::numbers::pi);
  }
  const double n = std::floor(x / (0.5 * std::numbers::pi) + 0.5);
  // Three subtractions whose roundings are kept: x - n pi/2 to twice the digits.
  const double first = x - n * kQuarter1;
  const double second = n * kQuarter2;
  const double upper = first - second;
  const double lost = (first - upper) - second;
  const double third = n * kQuarter3;
  const double angle = upper - third + lost;
  const double rest = (upper - angle) - third + lost - n * kQuarter3Rest;
  const auto whole = static_cast<std::int64_t>(n);
  return {.angle = angle, .rest = rest, .quarter = static_cast<int>(whole & 3)};
}

/// sin and cos of t for |t| <= pi/4, by their Taylor series.
double SineNearZero(const Turned& t) {
  const double x2 = t.angle * t.angle;
  double sum = 1.0;
  for (int n = 21; n >= 5; n -= 2) {
    sum = 1.0 - sum * x2 / ((n - 1) * n);
  }
  return t.angle - (t.angle * x2 / 6.0 * sum - t.rest * (1.0 - 0.5 * x2));
}

double CosineNearZero(const Turned& t) {
  const double x2 = t.angle * t.angle;
  double sum = 1.0;
  for (int n = 20; n >= 4; n -= 2) {
    sum = 1.0 - sum * x2 / ((n - 1) * n);
  }
  const double half = 0.5 * x2;
  const double head = 1.0 - half;
  return head + (((1.0 - head) - half) + (half * (1.0 - sum) - t.angle * t.rest));
}

double SineOf(Turned t, int quarters) {
  const int quarter = (t.quarter + quarters) & 3;
  const double size = (quarter & 1) != 0 ? CosineNearZero(t) : SineNearZero(t);
  return (quarter & 2) != 0 ? -size : size;
}

/// x^n for 1 <= n <= 64.
double Repeated(double x, int n) {
  double result = 1;
  for (double square = x; n > 0; n /= 2, square *= square) {
    result = n % 2 != 0 ? result * square : result;
  }
  return result;
}

}  // namespace

double Exp(double x) {
  if (!(x <= 709.79)) {
    return std::isnan(x) ? x : kInfinity;
  }
  if (x < -746) {
    return 0;
  }
  const double k = std::floor(x / std::numbers::ln2 + 0.5);
  const double upper = x - k * kLn2High;
  const double lower = k * kLn2Low;
  const double r = upper - lower;
  const double lost = (upper - r) - lower;
  return Scaled(1.0 + (r + (ExpBeyondLinear(r) + lost)), static_cast<int>(k));
}

double Expm1(double x) { return std::abs(x) < 0.34 ? x + ExpBeyondLinear(x) : Exp(x) - 1.0; }

double Log(double x) {
  if (!(x > 0) || x == kInfinity) {
    return x == 0 ? -kInfinity : (x > 0 ? x : kNaN);
  }
  int exponent = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    exponent = -54;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  exponent += static_cast<int>(bits >> 52U) - 1023;
  double mantissa = std::bit_cast<double>((bits & 0x000FFFFFFFFFFFFFULL) | 0x3FF0000000000000ULL);
  if (mantissa > std::numbers::sqrt2) {
    mantissa *= 0.5;
    ++exponent;
  }
  // ln(1 + f) = f - (h - s (h + R)), s = f/(2 + f), h = f^2/2, R = 2 s^2 (1/3 + s^2/5 + ...)
  const double f = mantissa - 1.0;
  const double s = f / (2.0 + f);
  const double s2 = s * s;
  double series = 1.0 / 25.0;
  for (int n = 23; n >= 3; n -= 2) {
    series = series * s2 + 1.0 / n;
  }
  const double h = 0.5 * f * f;
  const double tail = s * (h + 2.0 * s2 * series);
  const double k = exponent;
  return k * kLn2High - ((h - (tail + k * kLn2Low)) - f);
}

double Log1p(double x) {
  const double u = 1.0 + x;
  if (u == 1.0 || !(std::abs(x) < kInfinity)) {
    return x == -kInfinity ? kNaN : x;
  }
  return u > 0 ? Log(u) * (x / (u - 1.0)) : Log(u);
}

double Pow(double x, double y) {
  if (y == 0 || x == 1) {
    return 1;
  }
  if (std::isnan(x) || std::isnan(y)) {
    return kNaN;
  }
  if (std::abs(y) == kInfinity) {
    const double size = std::abs(x);
    return size == 1 ? 1 : ((size > 1) == (y > 0) ? kInfinity : 0);
  }
  const bool whole = y == std::floor(y);
  if (whole && std::abs(y) <= 64) {
    const double size = Repeated(x, static_cast<int>(std::abs(y)));
    return y > 0 ? size : 1.0 / size;
  }
  if (x < 0 && !whole && x > -kInfinity) {
    return kNaN;
  }
  const bool odd = whole && 0.5 * y != std::floor(0.5 * y);
  const double size = Exp(y * Log(std::abs(x)));
  return odd && std::signbit(x) ? -size : size;
}

double CubeRoot(double x) {
  if (x == 0 || !(std::abs(x) < kInfinity)) {
    return x;
  }
  const double size = std::abs(x);
  const double guess = Exp(Log(size) / 3.0);
  // A step of Newton's; its rounding errors are those of a small correction.
  const double root = guess - (guess - size / (guess * guess)) / 3.0;
  return x < 0 ? -root : root;
}

double Sine(double x) { return x == 0 ? x : SineOf(Reduced(x), 0); }

double Cosine(double x) { return SineOf(Reduced(x), 1); }

double Tangent(double x) {
  const Turned t = Reduced(x);
  return x == 0 ? x : SineOf(t, 0) / SineOf(t, 1);
}

double HyperbolicTangent(double x) {
  const double size = std::abs(x);
  if (size > 22) {
    return x > 0 ? 1.0 : -1.0;
  }
  const double e = Expm1(2.0 * size);
  const double result = e / (e + 2.0);
  return x < 0 ? -result : result;
}

double Arctangent(double x) {
  // arctan x = arctan c + arctan((x - c)/(1 + c x)), so that the series sees less than 7/16; the
  // constants in two parts [fdlibm, s_atan.c].
  constexpr double kHalf = 4.63647609000806093515e-01;
  constexpr double kHalfRest = 2.26987774529616870924e-17;
  constexpr double kOne = 7.85398163397448278999e-01;
  constexpr double kOneRest = 3.06161699786838301793e-17;
  constexpr double kThreeHalves = 9.82793723247329054082e-01;
  constexpr double kThreeHalvesRest = 1.39033110312309984516e-17;
  constexpr double kInfinite = 1.57079632679489655800e+00;
  constexpr double kInfiniteRest = 6.12323399573676603587e-17;
  const double size = std::abs(x);
  double t = size;
  double base = 0;
  double rest = 0;
  if (size >= 2.4375) {
    t = -1.0 / size;
    base = kInfinite;
    rest = kInfiniteRest;
  } else if (size >= 1.1875) {
    t = (size - 1.5) / (1.0 + 1.5 * size);
    base = kThreeHalves;
    rest = kThreeHalvesRest;
  } else if (size >= 0.6875) {
    t = (size - 1.0) / (size + 1.0);
    base = kOne;
    rest = kOneRest;
  } else if (size >= 0.4375) {
    t = (2.0 * size - 1.0) / (2.0 + size);
    base = kHalf;
    rest = kHalfRest;
  }
  const double t2 = t * t;
  double series = 1.0 / 51.0;
  for (int n = 49; n >= 3; n -= 2) {
    series = 1.0 / n - series * t2;
  }
  const double result = base - ((t * t2 * series - rest) - t);
  return x < 0 ? -result : result;
}

double Direction(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) {
    return kNaN;
  }
  if (y == 0) {
    return std::signbit(x) && x != 0 ? std::copysign(std::numbers::pi, y) : y;
  }
  const double steep = Arctangent(std::abs(y) / std::abs(x));  // x = 0: of infinity
  const double size = x < 0 ? std::numbers::pi - (steep - 1.2246467991473532e-16) : steep;
  return y < 0 ? -size : size;
}

double ErrorFunction(double x) {
  const double within = x > 3 ? 3 : (x < -3 ? -3 : x);
  const double x2 = within * within;
  double term = within;  // erf x = 2/sqrt(pi) e^(-x^2) sum of 2^n x^(2n+1)/(2n+1)!!
  double sum = within;
  for (int n = 1; n < 60; ++n) {
    term *= 2.0 * x2 / (2 * n + 1);
    sum += term;
  }
  return 2.0 * std::numbers::inv_sqrtpi * Exp(-x2) * sum;
}

double Hypotenuse(double x, double y, double z) { return std::sqrt(x * x + y * y + z * z); }

}  // namespace calib::dem
