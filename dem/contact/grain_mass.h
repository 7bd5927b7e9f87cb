#pragma once
// Masses of grains that touch, from their radii alone.

#include <numbers>

#include "dem/contact/quad.h"

namespace calib::dem {

/// Masses of grains by their radius r: m = unit r^3 for spheres, m = unit r^2 depth = rho pi r^2 t
/// for disks, as InertiaOf() has them.
struct GrainMass {
  double unit = 0;   ///< 4/3 pi rho [kg/m^3]
  double depth = 0;  ///< 3/4 of the thickness t of disks [m]; 0: the grains are spheres
};

/// Masses of grains of a density [kg/m^3] > 0; thickness: of disks [m], 0: the grains are spheres.
inline GrainMass GrainMassOf(double density, double thickness) {
  return {.unit = 4.0 / 3.0 * std::numbers::pi * density, .depth = 0.75 * thickness};
}

/// Effective mass m* = factor m_i m_j/(m_i + m_j) [kg] of grains of radii ri, rj [m] > 0; factor:
/// ContactBlock::mass_factor.
CALIB_DEM_INLINE double EffectiveMass(const GrainMass& grains, double factor, double ri,
                                      double rj) {
  const double i = ri * ri * (grains.depth > 0 ? grains.depth : ri);
  const double j = rj * rj * (grains.depth > 0 ? grains.depth : rj);
  return factor * grains.unit * (i * j / (i + j));
}

}  // namespace calib::dem
