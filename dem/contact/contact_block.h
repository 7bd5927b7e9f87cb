#pragma once
// The scratch that contact laws and effects work on: a block of touching pairs, one lane per
// contact, one array per quantity, so that every kernel is a plain loop over lanes that the
// compiler turns into vector instructions.

#include <algorithm>
#include <cassert>
#include <cstring>

namespace calib::dem {

/// Lanes of a block [-]. Chosen: a block stays well inside the first-level cache (dem/DECISIONS.md,
/// blocks of contacts).
inline constexpr int kBlock = 32;
/// Doubles that one contact can remember between steps [-]. Chosen: ContactModel asserts that no
/// model asks for more.
inline constexpr int kMaxHistory = 16;

/// A block of contacts. Grain i is the one with the smaller index; n points from i to j. All lanes
/// are always valid numbers: lanes from `count` on repeat lane 0, so that kernels need no remainder
/// loop and can raise no spurious NaN. SI units; forces and moments act on grain j, the opposite
/// ones on grain i.
struct alignas(64) ContactBlock {
  using Lane = double[kBlock];

  ContactBlock() = default;
  ~ContactBlock() = default;
  /// Precondition: other.history is other.own_history.
  ContactBlock(const ContactBlock& other) {
    assert(other.history == other.own_history);
    std::memcpy(static_cast<void*>(this), static_cast<const void*>(&other), sizeof other);
    history = own_history;
  }
  ContactBlock& operator=(const ContactBlock&) = delete;

  // Set by the caller for the whole block.
  int count = 0;  ///< lanes in use
  double dt = 0;  ///< time since the last evaluation [s]; 0: evaluate without moving on
  double sliding_friction = 0;  ///< tan(phi_mu), or what replaces it during consolidation [-] >= 0
  bool wall = false;            ///< j is a wall: see ComputeWallKinematics
  double mass_factor = 1;       ///< m* over m_i m_j/(m_i + m_j): 2 where j mirrors i for a wall
  double viscous = 1;           ///< 1: viscous effects act; 0: not, as during consolidation
  double stretch[3] = {0, 0, 0};  ///< homogeneous velocity gradient of the cell, diagonal [1/s]
  double shear = 0;               ///< component dvx/dz of the cell's velocity gradient [1/s]

  // Set by the caller per contact.
  int pair[kBlock];         ///< slot in the neighbour list
  Lane dx, dy, dz;          ///< branch vector: centre of j minus centre of i, nearest image [m]
  Lane radius_i, radius_j;  ///< [m]
  Lane vx, vy, vz;          ///< peculiar velocity of j minus that of i [m/s]
  Lane wix, wiy, wiz;       ///< angular velocity of i [rad/s]
  Lane wjx, wjy, wjz;       ///< angular velocity of j [rad/s]

  // Kinematics (contact_kinematics).
  Lane nx, ny, nz;              ///< unit normal from i to j
  Lane overlap;                 ///< u = r_i + r_j - distance [m]; below zero only where a kernel
                                ///< holds the contact
  Lane effective_radius;        ///< r* = r_i r_j / (r_i + r_j) [m]
  Lane normal_velocity;         ///< rate of separation [m/s]
  Lane slip_x, slip_y, slip_z;  ///< tangential displacement of j against i during dt [m]
  Lane roll_x, roll_y, roll_z;  ///< relative rotation without its normal part during dt [rad]
  Lane twist;                   ///< relative rotation about n during dt [rad]
  Lane spin;                    ///< mean rotation of both grains about n during dt [rad]
  Lane tilt_x, tilt_y, tilt_z;  ///< half the change of n during dt

  // Response, filled by the kernels in the order of ContactStage.
  Lane normal_force;      ///< repulsion positive [N]
  Lane normal_stiffness;  ///< tangent dFn/du [N/m]
  Lane may_stiffen = {};  ///< what normal_stiffness may grow by from one step to the next, as where
                          ///< contacts unload stiffer than they load; for the time step [N/m] >= 0
  Lane tangential_stiffness;  ///< ks [N/m]
  Lane attraction;            ///< part of the normal force that pulls, which friction does not feel
                              ///< missing: its limit is tan(phi_mu) (normal_force + attraction) [N]
  Lane holds;                 ///< above zero: the contact goes on acting although overlap <= 0
  Lane normal_damping;        ///< viscous coefficient, for the time step [N s/m] >= 0
  Lane tangential_damping;    ///< viscous coefficient of slip, for the time step [N s/m] >= 0
  Lane sliding_limit;         ///< largest |Fs| [N]
  Lane fx, fy, fz;            ///< shear force [N]
  Lane mx, my, mz;            ///< moment [N m]
  Lane rolling_stiffness;     ///< bending stiffness, for the time step [N m/rad]
  Lane twisting_stiffness;    ///< stiffness about the normal, for the time step [N m/rad]

  // Totals (contact_kinematics), after the last kernel.
  Lane force_x, force_y, force_z;        ///< on j [N]
  Lane torque_ix, torque_iy, torque_iz;  ///< on i [N m]
  Lane torque_jx, torque_jy, torque_jz;  ///< on j [N m]

  /// What the contacts remember; a kernel owns the columns from the `first` it was given on. In
  /// the block itself, or where the caller keeps them between steps (aligned as a block).
  Lane own_history[kMaxHistory];
  Lane* history = own_history;

  // Only used by models with several materials: set by the caller per contact; what follows from
  // the pair of materials is filled in by Materials::Complete().
  bool mixed = false;     ///< there are several materials
  int materials[kBlock];  ///< Materials::Pair() of i and j
  Lane friction;          ///< in place of sliding_friction; at walls set by the caller [-] >= 0
  Lane effective_mass;    ///< m* [kg]
};

/// Repeats lane 0 in the unused lanes, so that kernels meet valid numbers everywhere;
/// history: the first `width` columns.
inline void PadLanes(int width, ContactBlock& b) {
  for (ContactBlock::Lane* lane : {&b.dx, &b.dy, &b.dz, &b.radius_i, &b.radius_j, &b.vx, &b.vy,
                                   &b.vz, &b.wix, &b.wiy, &b.wiz, &b.wjx, &b.wjy, &b.wjz}) {
    std::fill(*lane + b.count, *lane + kBlock, (*lane)[0]);
  }
  for (int c = 0; c < width; ++c) {
    std::fill(b.history[c] + b.count, b.history[c] + kBlock, b.history[c][0]);
  }
  if (b.mixed) {
    std::fill(b.materials + b.count, b.materials + kBlock, b.materials[0]);
    std::fill(b.friction + b.count, b.friction + kBlock, b.friction[0]);
  }
}

}  // namespace calib::dem
