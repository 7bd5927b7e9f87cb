#pragma once
// The explicit step of the grains: velocities live at half steps, positions at whole ones.

#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// How the cell and the grains move during one time step.
struct Motion {
  double stretch[3] = {0, 0, 0};  ///< velocity gradient of the cell, compression negative [1/s]
  double shear = 0;               ///< velocity gradient dvx/dz [1/s]
  double dt = 0;                  ///< [s] > 0
  double damping = 0;             ///< local damping, 0 .. 1 [-]
  double drag = 0;                ///< global viscous damping: a -= drag v, also of spin [1/s] >= 0
};

/// Moves grains [begin, end) by their loads fx .. tz. Calls for ranges apart may run at the same
/// time.
///   v += dt F'/m,  F' = F (1 - damping sign(F (v + dt F/2m))) per component,
///   w += dt T'/I,  T' = T (1 - damping sign(T (w + dt T/2I))) per component,
///   x += dt (v + L x)
/// v is peculiar; the inertia of the homogeneous motion is left out, being of the order of the
/// squared inertial number. Local damping takes the sign of the velocity at mid-step.
/// [Cundall 1987]
void AdvanceGrains(const Motion& motion, int begin, int end, ParticleArrays& particles);

}  // namespace calib::dem
