#pragma once
// `pressure_dependent_friction`: friction that falls or grows with the load of a contact.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   mu = tan(phi_mu) (sigma/p_ref)^(-m),   sigma = Fn/d*^2,  d* = 4 r* (= d of equal grains)
/// sigma is the contact's own nominal pressure: on average about the mean stress p of the packing,
/// since p = Z phi F/(pi d^2) [Rumpf 1958] with coordination number times solid fraction near pi.
/// In one test at one pressure this is nearly another constant friction; it shows between
/// pressures. Fn is without adhesive pull. Two-sided, vanishes at m = 0; for Hertz contacts of
/// constant shear strength per area m = 1/3. sigma/p_ref below 1e-6 counts as 1e-6. [Bowden & Tabor
/// 1950; Archard 1957]
EffectEntry PressureDependentFriction();

}  // namespace calib::dem
