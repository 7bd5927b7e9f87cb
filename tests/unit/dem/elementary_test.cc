// The functions that stand in for libm, against libm in long double.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>

#include "dem/elementary/functions.h"
#include "dem/elementary/power.h"

namespace calib::dem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Numbers that look random, the same every time.
class Draws {
 public:
  double Between(double low, double high) {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return low + (high - low) * (static_cast<double>(state_ >> 11U) / 9007199254740992.0);
  }
  /// Even in the logarithm.
  double Scaled(double low, double high) {
    return std::exp(Between(std::log(low), std::log(high)));
  }

 private:
  std::uint64_t state_ = 7;
};

double ErrorInUlp(double found, long double exact) {
  const auto nearest = static_cast<double>(std::fabs(exact));
  const double ulp = std::nextafter(nearest, kInfinity) - nearest;
  return static_cast<double>(std::fabs(found - exact)) / ulp;
}

double Worst(const std::function<double(double)>& mine,
             const std::function<long double(long double)>& exact,
             const std::function<double(Draws&)>& argument) {
  Draws draws;
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    const double x = argument(draws);
    worst = std::max(worst, ErrorInUlp(mine(x), exact(static_cast<long double>(x))));
  }
  return worst;
}

double Signed(double low, double high, Draws& draws) {
  const double sign = draws.Between(-1, 1) < 0 ? -1 : 1;
  return sign * draws.Scaled(low, high);
}

using Long = long double;

TEST(Elementary, ExponentialsAreWithinAnUlp) {
  const auto exact = [](Long x) { return std::exp(x); };
  EXPECT_LT(Worst(&Exp, exact, [](Draws& d) { return d.Between(-708, 709.7); }), 1);
  EXPECT_LE(Worst(&Exp, exact, [](Draws& d) { return d.Between(-745, -708); }), 1);
  EXPECT_LT(Worst(&Exp, exact, [](Draws& d) { return Signed(1e-12, 1, d); }), 1);
  EXPECT_LT(Worst(
                &Expm1, [](Long x) { return std::expm1(x); },
                [](Draws& d) { return Signed(1e-15, 30, d); }),
            3);
  EXPECT_EQ(Exp(0), 1);
  EXPECT_EQ(Exp(-800), 0);
  EXPECT_EQ(Exp(-kInfinity), 0);
  EXPECT_EQ(Exp(710), kInfinity);
  EXPECT_EQ(Exp(kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(Exp(kNaN)));
}

TEST(Elementary, LogarithmsAreWithinAnUlp) {
  const auto exact = [](Long x) { return std::log(x); };
  EXPECT_LT(Worst(&Log, exact, [](Draws& d) { return d.Scaled(1e-320, 1e308); }), 1);
  EXPECT_LT(Worst(&Log, exact, [](Draws& d) { return 1 + Signed(1e-14, 0.5, d); }), 1);
  EXPECT_LT(Worst(
                &Log1p, [](Long x) { return std::log1p(x); },
                [](Draws& d) { return Signed(1e-18, 0.99, d); }),
            3);
  EXPECT_LT(Worst(
                &Log1p, [](Long x) { return std::log1p(x); },
                [](Draws& d) { return d.Scaled(0.5, 1e300); }),
            3);
  EXPECT_EQ(Log(1), 0);
  EXPECT_EQ(Log(0), -kInfinity);
  EXPECT_EQ(Log(kInfinity), kInfinity);
  EXPECT_EQ(Log1p(-1), -kInfinity);
  EXPECT_TRUE(std::isnan(Log(-1)));
  EXPECT_TRUE(std::isnan(Log1p(-2)));
  EXPECT_TRUE(std::isnan(Log(kNaN)));
}

TEST(Elementary, PowersKeepTheStatedBound) {
  Draws draws;
  double whole = 0;
  double real = 0;
  double kernels = 0;
  for (int k = 0; k < 20000; ++k) {
    const double x = draws.Scaled(1e-6, 1e6);
    const double n = std::floor(draws.Between(-40, 41));
    const double y = draws.Between(-40, 40);
    whole = std::max(
        whole, ErrorInUlp(Pow(-x, n), std::pow(Long{-x}, Long{n})) / std::max(1.0, std::abs(n)));
    const double allowed = 2 + 2 * std::abs(y * std::log(x));
    real = std::max(real, ErrorInUlp(Pow(x, y), std::pow(Long{x}, Long{y})) / allowed);
    kernels = std::max(kernels, ErrorInUlp(Power(x, y), std::pow(Long{x}, Long{y})) / allowed);
  }
  EXPECT_LT(whole, 1);
  EXPECT_LT(real, 1);
  EXPECT_LT(kernels, 1);
  for (const double x : {-kInfinity, -3.0, -1.0, -0.5, -0.0, 0.0, 0.5, 1.0, 3.0, kInfinity, kNaN}) {
    for (const double y :
         {-kInfinity, -71.0, -3.0, -2.0, -0.5, 0.0, 0.5, 2.0, 3.0, 71.0, kInfinity, kNaN}) {
      const double of_c = std::pow(x, y);
      const double found = Pow(x, y);
      if (std::isnan(of_c)) {
        EXPECT_TRUE(std::isnan(found)) << x << " " << y;
      } else if (std::isinf(of_c) || of_c == 0) {
        EXPECT_EQ(found, of_c) << x << " " << y;
        EXPECT_EQ(std::signbit(found), std::signbit(of_c)) << x << " " << y;
      } else {
        EXPECT_NEAR(found, of_c, 1e-13 * std::abs(of_c)) << x << " " << y;
      }
    }
  }
  EXPECT_LT(Worst(
                &CubeRoot, [](Long x) { return std::cbrt(x); },
                [](Draws& d) { return Signed(1e-300, 1e300, d); }),
            1);
  EXPECT_EQ(CubeRoot(-27), -3);
  EXPECT_EQ(Pow(10, 6), 1e6);
}

TEST(Elementary, CircularFunctionsAreWithinAnUlp) {
  const auto angles = [](Draws& d) { return Signed(1e-9, 1e6, d); };
  EXPECT_LT(Worst(
                &Sine, [](Long x) { return std::sin(x); }, angles),
            1);
  EXPECT_LT(Worst(
                &Cosine, [](Long x) { return std::cos(x); }, angles),
            1);
  EXPECT_LT(Worst(
                &Tangent, [](Long x) { return std::tan(x); }, angles),
            2);
  const auto turns = [](Draws& d) { return d.Between(-7, 7); };
  EXPECT_LT(Worst(
                &Sine, [](Long x) { return std::sin(x); }, turns),
            1);
  EXPECT_LT(Worst(
                &Cosine, [](Long x) { return std::cos(x); }, turns),
            1);
  EXPECT_LT(Worst(
                &Tangent, [](Long x) { return std::tan(x); }, turns),
            2);
  for (int k = 1; k < 100; ++k) {  // the zeros themselves
    const double x = k * std::numbers::pi;
    EXPECT_NEAR(Sine(x), static_cast<double>(std::sin(Long{x})), 1e-28);
  }
  EXPECT_EQ(Cosine(0), 1);
  EXPECT_EQ(Sine(0.5 * std::numbers::pi), 1);
  EXPECT_NEAR(Sine(1e9), std::sin(1e9), 1e-6);
  EXPECT_TRUE(std::isnan(Sine(kInfinity)));
  EXPECT_TRUE(std::isnan(Tangent(kNaN)));
}

TEST(Elementary, InverseAndHyperbolicFunctionsKeepTheStatedBound) {
  const auto sizes = [](Draws& d) { return Signed(1e-12, 1e12, d); };
  EXPECT_LT(Worst(
                &Arctangent, [](Long x) { return std::atan(x); }, sizes),
            2);
  EXPECT_LT(Worst(
                &Arctangent, [](Long x) { return std::atan(x); },
                [](Draws& d) { return d.Between(-4, 4); }),
            2);
  EXPECT_LT(Worst(
                &HyperbolicTangent, [](Long x) { return std::tanh(x); },
                [](Draws& d) { return Signed(1e-12, 30, d); }),
            3);
  Draws draws;
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    const double y = draws.Between(-1, 1);
    const double x = draws.Between(-1, 1);
    worst = std::max(worst, ErrorInUlp(Direction(y, x), std::atan2(Long{y}, Long{x})));
  }
  EXPECT_LT(worst, 3);
  for (const double y : {-1.0, -0.0, 0.0, 1.0}) {
    for (const double x : {-1.0, 0.0, 1.0}) {
      EXPECT_EQ(Direction(y, x), std::atan2(y, x)) << y << " " << x;
    }
  }
  for (double x = -3; x <= 3; x += 0.01) {
    EXPECT_NEAR(ErrorFunction(x), static_cast<double>(std::erf(Long{x})), 1e-15) << x;
  }
  EXPECT_EQ(Hypotenuse(3, 4), 5);
  EXPECT_EQ(Hypotenuse(2, 3, 6), 7);
}

}  // namespace
}  // namespace calib::dem
