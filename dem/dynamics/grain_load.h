#pragma once
// Force and torque of contacts on a grain, laid out for vector registers.

namespace calib::dem {

/// What contacts do to one of their grains. The fourth element of either is zero, so that a load
/// is two vector registers.
struct alignas(64) GrainLoad {
  double force[4];   ///< [N]
  double torque[4];  ///< about the centre [N m]
};

}  // namespace calib::dem
