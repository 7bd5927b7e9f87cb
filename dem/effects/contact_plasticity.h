#pragma once
// `contact_plasticity`: contacts that unload stiffer than they load.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   F = F_b                                     while F_b >= F_max (loading; F_max := F_b)
///   F = max(0, F_b - (kappa - 1)(F_max - F_b))  below, of stiffness kappa dF_b/du
/// F_b(u) is the force of the law, F_max the largest that the contact has carried since it formed,
/// kappa = k2/k1 >= 1. With linear contacts this is the hysteretic spring: loading k1, unloading
/// k2, zero force at u0 = (1 - k1/k2) u_max, restitution 1/sqrt(kappa). [Walton & Braun 1986;
/// Luding 2008, sec. 2.2 without adhesion] Shear stiffness stays that of the law. One-sided,
/// vanishes at kappa = 1. A contact that opens forgets; until then it counts as a contact, with or
/// without force.
EffectEntry ContactPlasticity();

}  // namespace calib::dem
