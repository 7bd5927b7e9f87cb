#pragma once
// Slopes of the free surface of grains at rest or in slow flow.

#include <optional>

#include "dem/geometry/vector3.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// A heap of grains.
struct Heap {
  double angle = 0;   ///< slope of the surface against the horizontal [rad]; 0: no heap
  double height = 0;  ///< above the floor at z = 0 [m]
};

/// The heap about the vertical through `axis`. The surface is the highest point of any grain in
/// each of eight sectors and each ring of width `diameter`, averaged with empty sectors as bare
/// floor; its slope is that of the least-squares line through the rings whose surface lies between
/// 15 % of the height, at least one diameter, and 85 %. No heap where fewer than three rings do, or
/// where it is lower than two diameters.
Heap ConicalHeap(const ParticleArrays& particles, const Vec3& axis, double diameter);

/// Slope of the surface over x [rad], positive where it rises with x: least-squares line through
/// the highest points in columns of width `diameter` over the middle `share` of the grains' extent.
/// Nothing where fewer than three columns hold grains.
std::optional<double> SurfaceSlope(const ParticleArrays& particles, double diameter, double share);

/// Where SigmoidPile() looks for a pile.
struct PileBounds {
  double wall = 0;     ///< x of the wall [m]
  double end = 0;      ///< x up to which columns are looked at [m]
  double highest = 0;  ///< z below which grains count [m]
};

/// Slope at the inflexion of h(x) = A/(1 + exp((x - x0)/w)) through the surface of a pile that
/// falls from a wall at x = `wall` on, A/(4 w) as an angle [rad]; by least squares over columns of
/// width `diameter` of the grains with z below `highest`. Nothing where fewer than four columns
/// hold grains. [Samuelsson 2023, sec. 4.1, Fig. 4.2]
std::optional<Heap> SigmoidPile(const ParticleArrays& particles, const PileBounds& bounds,
                                double diameter);

}  // namespace calib::dem
