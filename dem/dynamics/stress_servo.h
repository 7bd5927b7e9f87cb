#pragma once
// Moves one axis of the cell so that its stress reaches and keeps a target.

namespace calib::dem {

/// Proportional-integral control of the compression rate, in units of what the affine stiffness K
/// would need in one step: rate = (0.3 e + 0.005 sum e) / (K dt), e = target - stress. The integral
/// removes the lag that a steadily straining specimen would otherwise have; it is overdamped down
/// to a real stiffness of a fifth of K. What an axis needs while others are driven it no longer
/// needs when they stop: the integral is to be forgotten then, or it drives the stress away from
/// its target and unwinds only over hundreds of steps. Not thread-safe.
class StressServo {
 public:
  /// What the servo sees of its axis.
  struct Reading {
    double error = 0;     ///< target - stress [Pa]
    double modulus = 0;   ///< affine stiffness of the axis [Pa]; 0: nothing touches yet
    double dt = 0;        ///< [s] > 0
    double max_rate = 0;  ///< bound of the answer [1/s] > 0
  };

  /// Compression rate of the next step [1/s], within +/- max_rate. Without stiffness: full speed
  /// toward the target.
  double Update(const Reading& reading) {
    if (!(reading.modulus > 0)) {
      integral_ = 0;
      return reading.error > 0 ? reading.max_rate : (reading.error < 0 ? -reading.max_rate : 0.0);
    }
    const double scale = 1.0 / (reading.modulus * reading.dt);
    const double proportional = kProportional * reading.error * scale;
    const double trial = integral_ + kIntegral * reading.error * scale;
    const double rate = proportional + trial;
    if (rate > reading.max_rate) {
      return reading.max_rate;  // saturated: the integral waits
    }
    if (rate < -reading.max_rate) {
      return -reading.max_rate;
    }
    integral_ = trial;
    return rate;
  }

  /// Forgets the integral: what the axis needed while others were driven.
  void Forget() { integral_ = 0; }

 private:
  /// Gains of the control [-]. Chosen: overdamped down to a real stiffness of a fifth of K;
  /// what an axis does with them is held by tests/unit/dem/stress_servo_test.cc.
  static constexpr double kProportional = 0.3;
  static constexpr double kIntegral = 0.005;
  double integral_ = 0;  ///< compression rate that the axis needs in the long run [1/s]
};

}  // namespace calib::dem
