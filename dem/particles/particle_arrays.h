#pragma once
// State of all grains, one array per quantity. SI units.

#include <cstdint>
#include <vector>

#include "dem/particles/packing.h"

namespace calib::dem {

/// One element per sphere in every array that is not said to be empty.
struct ParticleArrays {
  std::vector<double> x, y, z;     ///< centres, unwrapped between neighbour searches [m]
  std::vector<double> vx, vy, vz;  ///< peculiar velocity: without the cell's homogeneous part [m/s]
  std::vector<double> wx, wy, wz;  ///< angular velocity [rad/s]
  std::vector<double> fx, fy, fz;  ///< net contact force of the last evaluation, before damping [N]
  std::vector<double> tx, ty, tz;  ///< net contact torque [N m]
  std::vector<double> radius;      ///< [m]
  std::vector<double> inverse_mass;     ///< [1/kg]
  std::vector<double> inverse_inertia;  ///< about the centre (InertiaOf) [1/(kg m^2)]
  std::vector<int> id;                  ///< index in the packing
  std::vector<int> body;                ///< clump of each sphere, -1: none; empty: no clumps at all
  std::vector<std::uint8_t> material;   ///< index in Materials; empty: the model has one material

  [[nodiscard]] int size() const { return static_cast<int>(x.size()); }
};

/// Mass and moment of inertia of one solid grain.
struct Inertia {
  double mass = 0;    ///< [kg]
  double moment = 0;  ///< about the centre; of a disk about its axis [kg m^2]
};

/// Mass and moment of a sphere, m = 4/3 pi r^3 rho and 2/5 m r^2, or, with a thickness [m] > 0, of
/// a disk, m = pi r^2 t rho and m r^2/2. radius [m] > 0, density [kg/m^3] > 0.
Inertia InertiaOf(double radius, double density, double thickness);

/// Grains at rest, in an order that keeps neighbours close in memory: by grid cell, then by
/// position, so that the order in which a file lists them does not matter. density [kg/m^3] > 0;
/// thickness [m]: see InertiaOf.
ParticleArrays MakeParticles(const Packing& packing, double density, double thickness = 0);

}  // namespace calib::dem
