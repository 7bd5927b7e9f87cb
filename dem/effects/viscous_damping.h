#pragma once
// What `viscous_damping` tells the engine of its dashpots.

#include "dem/contact/contact_kernel.h"
#include "dem/contact/grain_mass.h"

namespace calib::dem {

/// What the dashpots of `viscous_damping` have in common at all contacts of grains of one material.
struct Dashpot {
  double twice_ratio = 0;  ///< twice the damping ratio beta [-] >= 0
  GrainMass grains{};      ///< masses of the grains
};

/// The dashpots by the parameters of the effect. Pure. Precondition: the model has one material.
Dashpot DashpotFrom(const KernelContext& context);

}  // namespace calib::dem
