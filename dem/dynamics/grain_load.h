#pragma once

namespace calib::dem {

/// What one contact does to one of its grains.
struct GrainLoad {
  double force[3];   ///< [N]
  double torque[3];  ///< about the centre [N m]
};

}  // namespace calib::dem
