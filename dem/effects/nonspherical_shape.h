#pragma once
// `nonspherical_shape`: elongated grains in place of spheres.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// Every sphere becomes a rigid clump of two equal overlapping spheres of the same volume (of the
/// union), length over width `aspect`, directions at random; the specimen is brought to the new
/// shape at constant porosity before consolidation (simulation/shape_change.h). Null by definition
/// at aspect 1: spheres. One-sided. [Favier et al. 1999; Ng 2004, J. Eng. Mech. 130, 193]
EffectEntry NonsphericalShape();

}  // namespace calib::dem
