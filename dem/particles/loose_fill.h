#pragma once
// Grains set loosely into a container, in which they fall into place.

#include <cstdint>
#include <functional>
#include <vector>

#include "dem/geometry/vector3.h"
#include "dem/particles/clump_template.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Where grains are set.
struct FillRegion {
  Vec3 low{};         ///< corner of the box from which layers are filled upwards [m]
  double width = 0;   ///< along x [m]
  double depth = 0;   ///< along y [m]; 0: one layer of grains at low.y, in the plane of x and z
  double height = 0;  ///< of the region [m]; 0: as high as needed
  std::function<bool(const Vec3& centre, double radius)>
      holds{};  ///< whether a sphere may stand there
  bool repeats =
      false;  ///< the region repeats along y every `depth`: grains may lie across its border
};

/// The radii in an order drawn from the seed, set on a cubic lattice whose pitch is 1.08 largest
/// diameters, each displaced at random by up to 3 % of the largest radius, so that no two touch.
/// Fewer grains than radii come back where the region is too small. The same arguments give the
/// same bits.
Packing LooseFill(std::vector<double> radii, const FillRegion& region, std::uint64_t seed);

/// Grains of a shape, their radii in an order drawn from the seed, thrown one after another to
/// random places and directions where they touch no other (random sequential addition); in a plane
/// they are turned about y only, by any angle, and members of the shape have to lie at y = 0. A
/// region of unlimited height is filled from below: it grows by a grain's length whenever a grain
/// finds no place in 200 throws. Fewer grains come back where one finds none in 20 000 throws.
/// Clump ids count the grains. The same arguments give the same bits.
Packing RandomFill(std::vector<double> radii, const ClumpTemplate& shape, const FillRegion& region,
                   std::uint64_t seed);

/// z of the highest point of any grain [m]. Precondition: there is one.
double TopOf(const Packing& packing);

}  // namespace calib::dem
