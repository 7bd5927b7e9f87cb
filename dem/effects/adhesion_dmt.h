#pragma once
// `adhesion_dmt`: a constant attraction of touching grains.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   F = F_b - F_p,   F_p = 2 pi W R*,   |Fs| <= tan(phi_mu) (F + F_p),   R* = r1 r2/(r1 + r2)
/// Stiff, small grains: attraction acts around the contact and does not change its profile; it ends
/// with the contact. W is the work of adhesion [J/m^2]; codes that use the surface energy gamma
/// have W = 2 gamma. One-sided, vanishes at W = 0. [Derjaguin, Muller & Toporov 1975]
EffectEntry AdhesionDmt();

}  // namespace calib::dem
