#pragma once
// `viscous_damping`: dashpots beside the springs of a contact.

#include "dem/catalog/registry.h"
#include "dem/contact/grain_mass.h"

namespace calib::dem {

///   c = 2 beta sqrt(m* k),   m* = m1 m2/(m1 + m2),   k the tangent stiffness
///   normal: F = F_b + c du/dt, but a repulsive contact never pulls (F >= min(F_b, 0))
///   shear:  Fs = spring - c_s ds/dt with k = ks, only while the spring sticks (below the sliding
///           limit), and never beyond the limit
/// beta is the damping ratio of two grains on a linear spring, 1 critical. With linear contacts
/// their restitution is exp(-beta/sqrt(1-beta^2) (pi - arctan(2 beta sqrt(1-beta^2)/(2 beta^2-1))))
/// [Schwager & Poeschel 2007, Eq. 14]; with Hertz contacts it does not depend on speed either
/// [Tsuji, Tanaka & Ishida 1992]. Masses are those of the grains, spheres or disks. Off during
/// consolidation; in staged quasi-static tests little is left of it, since a settled state has no
/// velocities. One-sided, vanishes at beta = 0. The time step follows the dashpots.
EffectEntry ViscousDamping();

/// What the dashpots of all contacts have in common.
struct Dashpot {
  double twice_ratio = 0;  ///< 2 beta
  GrainMass grains{};
};
Dashpot DashpotFrom(const KernelContext& context);

}  // namespace calib::dem
