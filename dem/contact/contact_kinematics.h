#pragma once
// Geometry and relative motion of touching spheres, and the transport of what a contact remembers.

#include "dem/contact/contact_block.h"
#include "dem/contact/quad.h"

namespace calib::dem {

/// Computes, for contacts of two grains, normal, overlap and the increments of slip, rolling and
/// twisting during block.dt from branch vector, radii and velocities. The homogeneous velocity of
/// the cell acts over the branch vector.
///   n = d/|d|, u = r_i + r_j - |d|, v = v_j - v_i + L d
///   slip  = dt [ (r_i + r_j)/|d| (v - n (n.v)) - (r_i w_i + r_j w_j) x n ]
///   roll  = dt [ (w_j - w_i) - n (n.(w_j - w_i)) ]
///   twist = dt n.(w_j - w_i),   spin = dt/2 n.(w_i + w_j)
/// Slip uses rigid arms r_i, r_j (the translation scaled by (r_i + r_j)/|d|): objective, and
/// without the ratcheting that arms changing with the overlap give in cycles.
/// [McNamara, Garcia-Rojo, Herrmann, Phys. Rev. E 77 (2008) 031304]
/// Precondition: |d| > 0 in every lane.
void ComputeKinematics(ContactBlock& block);

/// Computes normal, overlap, slip, rolling and twisting, as ComputeKinematics() does for two
/// grains, for grain i at a wall j: d points from the centre to the nearest point of the wall, v is
/// the wall's velocity there minus that of the centre, w_j the wall's angular velocity. The wall is
/// a partner of infinite radius,
///   n = d/|d|, u = r_i - |d|, r* = r_i, slip = dt [ (v - n (n.v)) - r_i w_i x n ],
/// except where laws use the radii themselves (moments): there it counts as a mirror image, r_j =
/// r_i, and the effective mass is that of the grain (block.mass_factor = 2).
void ComputeWallKinematics(ContactBlock& block);

/// Carries a tangential vector (x, y, z) of lane k from the last tangent plane to the present one
/// and turns it with the mean spin of the grains about n:
///   s' = s - (n.s)(n - dn/2),   s'' = s' + spin n x s' - spin^2/2 s'.
/// s' is tangential; its length is kept to fourth order in the angle of the step.
CALIB_DEM_INLINE void TransportLane(const ContactBlock& b, int k, double& x, double& y, double& z) {
  const double nx = b.nx[k];
  const double ny = b.ny[k];
  const double nz = b.nz[k];
  const double along = nx * x + ny * y + nz * z;
  const double px = x - along * (nx - b.tilt_x[k]);
  const double py = y - along * (ny - b.tilt_y[k]);
  const double pz = z - along * (nz - b.tilt_z[k]);
  const double spin = b.spin[k];
  const double keep = 1.0 - 0.5 * spin * spin;
  x = keep * px + spin * (ny * pz - nz * py);
  y = keep * py + spin * (nz * px - nx * pz);
  z = keep * pz + spin * (nx * py - ny * px);
}

/// TransportLane() for all lanes of the vector in the three history columns from `first` on.
void TransportTangential(ContactBlock& block, int first);

/// Adds up what the contact does to its grains: force on j, torques with arms to the middle of the
/// overlap.
///   F = Fn n + Fs,   T_i = -(r_i - u/2) n x Fs - M,   T_j = -(r_j - u/2) n x Fs + M
void ComputeTotals(ContactBlock& block);

}  // namespace calib::dem
