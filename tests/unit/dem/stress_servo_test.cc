// The servo that holds a stress, on an elastic axis that is strained by others.
#include "dem/dynamics/stress_servo.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace calib::dem {
namespace {

constexpr double kTarget = 1e5;      // [Pa]
constexpr double kAffine = 1e8;      // [Pa]
constexpr double kStiffness = 5e7;   // of the axis: half the affine one [Pa]
constexpr double kServoStep = 1e-5;  // [s]
constexpr double kExpansion = 0.1;   // what others strain the axis by, compression positive [1/s]

/// An axis whose stress follows its own rate and what others do to it.
struct Axis {
  StressServo servo;
  double stress = kTarget;

  /// Largest departure from the target over some steps [Pa].
  double Hold(int steps, double compressed_by_others) {
    double largest = 0;
    for (int k = 0; k < steps; ++k) {
      const double rate = servo.Update(
          {.error = kTarget - stress, .modulus = kAffine, .dt = kServoStep, .max_rate = 1.0});
      stress += kStiffness * (rate + compressed_by_others) * kServoStep;
      largest = std::max(largest, std::abs(stress - kTarget));
    }
    return largest;
  }
};

TEST(StressServo, HoldsAnAxisThatOthersStrain) {
  Axis axis;
  axis.Hold(3000, kExpansion);
  EXPECT_NEAR(axis.stress, kTarget, 1e-3);
}

TEST(StressServo, DriftsFarLessWhenStrainingEndsAndItForgets) {
  Axis remembers;
  remembers.Hold(3000, kExpansion);
  Axis forgets = remembers;
  forgets.servo.Forget();
  EXPECT_GT(remembers.Hold(500, 0.0), 100.0);
  EXPECT_LT(forgets.Hold(500, 0.0), 1.0);
}

TEST(StressServo, GoesAtFullSpeedWhereNothingTouches) {
  StressServo servo;
  EXPECT_EQ(servo.Update({.error = 1.0, .modulus = 0.0, .dt = kServoStep, .max_rate = 0.3}), 0.3);
  EXPECT_EQ(servo.Update({.error = -1.0, .modulus = 0.0, .dt = kServoStep, .max_rate = 0.3}), -0.3);
}

}  // namespace
}  // namespace calib::dem
