#pragma once

namespace calib::dem {

/// What contacts do to one of their grains. The last element of either is zero: a load is two
/// vector registers.
struct alignas(64) GrainLoad {
  double force[4];   ///< [N]
  double torque[4];  ///< about the centre [N m]
};

}  // namespace calib::dem
