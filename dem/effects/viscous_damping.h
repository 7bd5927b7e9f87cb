#pragma once
// What `viscous_damping` tells the engine of its dashpots.

#include "dem/contact/contact_kernel.h"
#include "dem/contact/grain_mass.h"

namespace calib::dem {

/// What the dashpots of all contacts have in common.
struct Dashpot {
  double twice_ratio = 0;  ///< 2 beta
  GrainMass grains{};
};
Dashpot DashpotFrom(const KernelContext& context);

}  // namespace calib::dem
