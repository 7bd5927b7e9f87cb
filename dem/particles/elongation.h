#pragma once
// Shape of the clumps that stand for elongated grains: two equal overlapping spheres.

#include "dem/particles/packing.h"

namespace calib::dem {

/// Two spheres whose union has the volume of the sphere that they replace, per its radius.
struct Dumbbell {
  double radius = 1;  ///< of each sphere [-]
  double offset = 0;  ///< of each centre from the middle [-]
};

/// The dumbbell whose length over width is `aspect` = 1 + offset/radius, in [1, 2]; at 2 the
/// spheres just touch.
///   4/3 pi = 8/3 pi r^3 - pi/12 (4 r + 2 c)(2 r - 2 c)^2  with c = (aspect - 1) r
Dumbbell DumbbellOf(double aspect);

/// Replaces every sphere of the packing by a dumbbell of equal volume at the same centre, of random
/// orientation (Philox with the grain's index as counter, the same for every aspect). Clump ids are
/// the indices of the spheres. Preconditions: single spheres only; aspect in [1, 2].
Packing Elongated(const Packing& spheres, double aspect);

}  // namespace calib::dem
