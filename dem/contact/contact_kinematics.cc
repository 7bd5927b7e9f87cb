#include "dem/contact/contact_kinematics.h"

#include <cmath>

#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

/// Relative and mean rotation of lane k during dt; the normal is there.
inline void SetRotation(ContactBlock& b, int k) {
  const double dt = b.dt;
  const double nx = b.nx[k];
  const double ny = b.ny[k];
  const double nz = b.nz[k];
  const double rx = dt * (b.wjx[k] - b.wix[k]);
  const double ry = dt * (b.wjy[k] - b.wiy[k]);
  const double rz = dt * (b.wjz[k] - b.wiz[k]);
  const double twist = nx * rx + ny * ry + nz * rz;
  b.twist[k] = twist;
  b.roll_x[k] = rx - nx * twist;
  b.roll_y[k] = ry - ny * twist;
  b.roll_z[k] = rz - nz * twist;
  b.spin[k] =
      0.5 * dt *
      (nx * (b.wix[k] + b.wjx[k]) + ny * (b.wiy[k] + b.wjy[k]) + nz * (b.wiz[k] + b.wjz[k]));
}

}  // namespace

CALIB_DEM_CLONES void ComputeKinematics(ContactBlock& b) {
  const double dt = b.dt;
  const double lx = b.stretch[0];
  const double ly = b.stretch[1];
  const double lz = b.stretch[2];
  const double shear = b.shear;
  for (int k = 0; k < kBlock; ++k) {
    const double ri = b.radius_i[k];
    const double rj = b.radius_j[k];
    const double sum = ri + rj;
    const double distance = std::sqrt(b.dx[k] * b.dx[k] + b.dy[k] * b.dy[k] + b.dz[k] * b.dz[k]);
    const double both = 1.0 / (distance * sum);  // one division serves two
    const double inverse = both * sum;
    const double nx = b.dx[k] * inverse;
    const double ny = b.dy[k] * inverse;
    const double nz = b.dz[k] * inverse;
    b.nx[k] = nx;
    b.ny[k] = ny;
    b.nz[k] = nz;
    b.overlap[k] = sum - distance;
    b.effective_radius[k] = ri * rj * (both * distance);

    const double vx = b.vx[k] + lx * b.dx[k] + shear * b.dz[k];
    const double vy = b.vy[k] + ly * b.dy[k];
    const double vz = b.vz[k] + lz * b.dz[k];
    const double vn = nx * vx + ny * vy + nz * vz;
    b.normal_velocity[k] = vn;
    const double tx = vx - nx * vn;
    const double ty = vy - ny * vn;
    const double tz = vz - nz * vn;

    const double half_turn = 0.5 * dt * inverse;
    b.tilt_x[k] = half_turn * tx;
    b.tilt_y[k] = half_turn * ty;
    b.tilt_z[k] = half_turn * tz;

    const double cx = ri * b.wix[k] + rj * b.wjx[k];
    const double cy = ri * b.wiy[k] + rj * b.wjy[k];
    const double cz = ri * b.wiz[k] + rj * b.wjz[k];
    const double rigid = sum * inverse;
    b.slip_x[k] = dt * (rigid * tx - (cy * nz - cz * ny));
    b.slip_y[k] = dt * (rigid * ty - (cz * nx - cx * nz));
    b.slip_z[k] = dt * (rigid * tz - (cx * ny - cy * nx));

    SetRotation(b, k);
  }
}

CALIB_DEM_CLONES void ComputeWallKinematics(ContactBlock& b) {
  const double dt = b.dt;
  for (int k = 0; k < kBlock; ++k) {
    const double r = b.radius_i[k];
    const double distance = std::sqrt(b.dx[k] * b.dx[k] + b.dy[k] * b.dy[k] + b.dz[k] * b.dz[k]);
    const double inverse = 1.0 / distance;
    const double nx = b.dx[k] * inverse;
    const double ny = b.dy[k] * inverse;
    const double nz = b.dz[k] * inverse;
    b.nx[k] = nx;
    b.ny[k] = ny;
    b.nz[k] = nz;
    b.overlap[k] = r - distance;
    b.effective_radius[k] = r;
    const double vn = nx * b.vx[k] + ny * b.vy[k] + nz * b.vz[k];
    b.normal_velocity[k] = vn;
    const double cx = r * b.wix[k];
    const double cy = r * b.wiy[k];
    const double cz = r * b.wiz[k];
    b.slip_x[k] = dt * (b.vx[k] - nx * vn - (cy * nz - cz * ny));
    b.slip_y[k] = dt * (b.vy[k] - ny * vn - (cz * nx - cx * nz));
    b.slip_z[k] = dt * (b.vz[k] - nz * vn - (cx * ny - cy * nx));
    // The normal hardly turns in a step, and projecting what is remembered loses only the square.
    b.tilt_x[k] = b.tilt_y[k] = b.tilt_z[k] = 0.0;
    SetRotation(b, k);
  }
}

CALIB_DEM_CLONES void TransportTangential(ContactBlock& b, int first) {
  double* const sx = b.history[first];
  double* const sy = b.history[first + 1];
  double* const sz = b.history[first + 2];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    double x = sx[k];
    double y = sy[k];
    double z = sz[k];
    TransportLane(b, k, x, y, z);
    sx[k] = x;
    sy[k] = y;
    sz[k] = z;
  }
}

CALIB_DEM_CLONES void ComputeTotals(ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const double nx = b.nx[k];
    const double ny = b.ny[k];
    const double nz = b.nz[k];
    b.force_x[k] = b.normal_force[k] * nx + b.fx[k];
    b.force_y[k] = b.normal_force[k] * ny + b.fy[k];
    b.force_z[k] = b.normal_force[k] * nz + b.fz[k];
    const double tx = ny * b.fz[k] - nz * b.fy[k];
    const double ty = nz * b.fx[k] - nx * b.fz[k];
    const double tz = nx * b.fy[k] - ny * b.fx[k];
    const double arm_i = b.radius_i[k] - 0.5 * b.overlap[k];
    const double arm_j = b.radius_j[k] - 0.5 * b.overlap[k];
    b.torque_ix[k] = -arm_i * tx - b.mx[k];
    b.torque_iy[k] = -arm_i * ty - b.my[k];
    b.torque_iz[k] = -arm_i * tz - b.mz[k];
    b.torque_jx[k] = b.mx[k] - arm_j * tx;
    b.torque_jy[k] = b.my[k] - arm_j * ty;
    b.torque_jz[k] = b.mz[k] - arm_j * tz;
  }
}

}  // namespace calib::dem
