#pragma once
// The shape of rigid clumps that replace spheres: a few overlapping spheres.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/particles/packing.h"
#include "dem/particles/union_of_spheres.h"

namespace calib::dem {

/// Spheres whose union has the volume of a sphere of radius 1; the mean of their centres is the
/// origin.
struct ClumpTemplate {
  std::vector<Sphere> spheres;
};

/// Spheres that a clump may have [-]. Chosen: every sphere has contacts of its own, so that
/// cost grows with their number.
inline constexpr int kMostSpheresOfAClump = 64;

/// Reads `x y z r` per line, blank lines and # comments allowed, in any unit of length: the shape
/// is scaled to the volume (of the union; MomentsOfUnion says how exactly) and set about the
/// origin. Appends everything wrong to problems: not four numbers, radius <= 0, fewer than two
/// spheres or more than kMostSpheresOfAClump, a sphere that overlaps no other, all within one of
/// them; the result is meaningful only if none was added.
ClumpTemplate ParseClumpTemplate(const std::string& text, std::vector<PackingProblem>& problems);

/// Two equal spheres along z, length over width `aspect` in (1, 2]. For disks: DiskPairTemplate().
ClumpTemplate DumbbellTemplate(double aspect);

/// The shape on its way from a sphere of radius 1 (share 0) to the template (share 1), always of
/// the same volume: centres at `share` of their places, radii between 1 and their own, all scaled.
ClumpTemplate Between(const ClumpTemplate& shape, double share);

/// Largest distance of a surface from the origin, in radii of the sphere that it replaces.
double ReachOf(const ClumpTemplate& shape);

/// Rows of a rotation matrix.
using Rotation = std::array<std::array<double, 3>, 3>;

/// Rotation of a grain, drawn uniformly from all rotations: a unit quaternion from the three
/// numbers of draw `draw` (random_numbers.h). [Shoemake 1992, Graphics Gems III, p. 124]
Rotation DrawRotation(std::uint64_t seed, int grain, int draw);

/// Rotation of a grain about y by an angle drawn uniformly from all angles, from the first number
/// of draw `draw` (random_numbers.h).
Rotation DrawRotationInPlane(std::uint64_t seed, int grain, int draw);

/// The rotation that turns z to the horizontal direction at `angle` [rad] from x towards y.
Rotation LaidDown(double angle);

/// Where a sphere `member` of a shape lies in a grain [m] that is turned by `rotation`, has its
/// centre at `centre` [m] and the volume of a sphere of `radius` [m] > 0.
Sphere Placed(const Sphere& member, const Rotation& rotation, double radius,
              const std::array<double, 3>& centre);

/// The packing with every sphere replaced by a clump of the shape of equal volume about the same
/// centre, turned by a rotation drawn from the seed. Clump ids are the indices of the spheres.
Packing Replaced(const Packing& spheres, const ClumpTemplate& shape, std::uint64_t seed);

}  // namespace calib::dem
