#pragma once
// `capillary_bridges`: liquid bridges that form on touching and hold across a gap.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// With R = 2 r1 r2/(r1 + r2) (Derjaguin), gap s = max(0, -u), bridge volume V, contact angle
/// theta:
///   F = 2 pi R gamma cos(theta) / (1 + 1.05 S + 2.5 S^2),  S = s sqrt(R/V)
///                                                        [Willett et al. 2000, Eq. 12]
///   rupture at s = (1 + theta/2) V^(1/3)                 [Lian et al. 1993]
/// V is `liquid_volume` per bridge or `volume_ratio` R^3. A bridge forms when grains touch, with
/// its full volume (liquid is neither counted nor shared), and is gone after rupture until they
/// touch again. The closed form holds for V < 0.01 R^3 and theta < 50 degrees. Sliding limit
/// tan(phi_mu) times the force between the solids. Pairs across a gap are no contacts in the
/// coordination number, but their force is part of stress. One-sided, vanishes at gamma = 0.
EffectEntry CapillaryBridges();

}  // namespace calib::dem
