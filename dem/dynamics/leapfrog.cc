#include "dem/dynamics/leapfrog.h"

#include <vector>

#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

/// One component: force or torque over inertia into velocity.
struct Kick {
  const double* load;
  const double* inverse_inertia;
  double* velocity;
};

CALIB_DEM_CLONES void ApplyKick(const Kick kick, double dt, double damping, int begin, int end) {
  const double* const __restrict load = kick.load;
  const double* const __restrict inverse_inertia = kick.inverse_inertia;
  double* const __restrict velocity = kick.velocity;
  const double opposing = 1.0 + damping;
  const double driving = 1.0 - damping;
  for (int g = begin; g < end; ++g) {
    const double a = load[g] * inverse_inertia[g];
    const double power = a * (velocity[g] + 0.5 * dt * a);
    const double factor =
        power > 0 ? driving : opposing;  // where the power is zero, so is the load or its effect
    velocity[g] += dt * (a * factor);
  }
}

CALIB_DEM_CLONES void Drift(const double* __restrict v, double stretch, double dt, int begin,
                            int end, double* __restrict x) {
  for (int g = begin; g < end; ++g) {
    x[g] += dt * (v[g] + stretch * x[g]);
  }
}

/// The share of x in the shear of the cell.
CALIB_DEM_CLONES void ShearDrift(const double* __restrict z, double shear, double dt, int begin,
                                 int end, double* __restrict x) {
  for (int g = begin; g < end; ++g) {
    x[g] += dt * (shear * z[g]);
  }
}

}  // namespace

void AdvanceGrains(const Motion& motion, int begin, int end, ParticleArrays& p) {
  const Kick kicks[6] = {
      {p.fx.data(), p.inverse_mass.data(), p.vx.data()},
      {p.fy.data(), p.inverse_mass.data(), p.vy.data()},
      {p.fz.data(), p.inverse_mass.data(), p.vz.data()},
      {p.tx.data(), p.inverse_inertia.data(), p.wx.data()},
      {p.ty.data(), p.inverse_inertia.data(), p.wy.data()},
      {p.tz.data(), p.inverse_inertia.data(), p.wz.data()},
  };
  for (const Kick& kick : kicks) {
    ApplyKick(kick, motion.dt, motion.damping, begin, end);
  }
  if (motion.drag > 0) {
    const double keep = 1.0 - motion.drag * motion.dt;
    for (auto* velocity : {&p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz}) {
      for (int g = begin; g < end; ++g) {
        (*velocity)[static_cast<std::size_t>(g)] *= keep;
      }
    }
  }
  Drift(p.vx.data(), motion.stretch[0], motion.dt, begin, end, p.x.data());
  Drift(p.vy.data(), motion.stretch[1], motion.dt, begin, end, p.y.data());
  if (motion.shear != 0) {  // z is still that of the beginning of the step
    ShearDrift(p.z.data(), motion.shear, motion.dt, begin, end, p.x.data());
  }
  Drift(p.vz.data(), motion.stretch[2], motion.dt, begin, end, p.z.data());
}

}  // namespace calib::dem
