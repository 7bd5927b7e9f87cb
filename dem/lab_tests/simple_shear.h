#pragma once
// `simple_shear`: the top displaced over the bottom at constant normal stress or constant volume.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// The periodic cell is sheared along x over its height (Lees-Edwards boundaries along z), without
/// strain along x and y. The normal (axial) stress keeps the value of the end of consolidation, or,
/// with constant_volume 1, the height does. Shear strain is the displacement of the top over the
/// height at the end of consolidation, as a direct simple shear device gives it (ASTM D6528).
/// [Lees & Edwards 1972]
ElementTestEntry SimpleShear();

}  // namespace calib::dem
