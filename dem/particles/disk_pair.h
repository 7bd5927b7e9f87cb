#pragma once
// Elongated grains of a plane: two equal disks that overlap.

#include "dem/particles/clump_template.h"

namespace calib::dem {

/// Moments of a flat plate.
struct PlateMoments {
  double area = 0;   ///< [m^2]
  double polar = 0;  ///< second moment about the normal through the middle [m^4]
};

/// Moments of the union of two disks of `radius` > 0 [m] whose centres stand `offset` >= 0 [m] from
/// the middle; exact while they overlap or just touch (offset <= radius).
PlateMoments MomentsOfDiskPair(double radius, double offset);

/// Two equal disks along z whose union has the area of a disk of radius 1; length over width
/// `aspect` in (1, 2].
ClumpTemplate DiskPairTemplate(double aspect);

}  // namespace calib::dem
