#pragma once
// The largest step at which leapfrog stays stable, from what the contacts of each body do to that
// body alone.
//
// The energy of a contact between i and j is that of a spring k over the difference of what both
// do, and (a - b)^2 <= (1 + t) a^2 + (1 + 1/t) b^2 for any t > 0. So K of all bodies together is no
// larger than bodies that do not know each other, where each contact holds i with (1 + t) k and j
// with (1 + 1/t) k, and the square of the fastest rate is at most the largest eigenvalue of one
// body's M^-1 K. t = 1 is the usual bound; t = m_i/m_j, for which a pair has just the rate of its
// reduced mass, is far sharper where grains differ in size (dem/DECISIONS.md). It holds for the
// stiffnesses of the moment, and where sliding does not couple normal and tangential motion.

#include <array>
#include <span>

namespace calib::dem {

/// What contacts do to one of their bodies: springs, or dashpots per rate. SI units: [N/m], [N
/// m/rad].
struct alignas(64) OwnStiffness {
  // When the body moves and all others stay: along and about the axes x, y, z; the fourth is zero.
  double translation[4];
  double rotation[4];
  double moment[4];  ///< part of `rotation` that moments of contacts do, not forces
  // The body's share when all bodies move: matrices of order three, xx, yy, zz and xy, yz, zx.
  double shared[4];           ///< translation; and couple x
  double shared_off[4];       ///< translation; and couple y
  double shared_turn[4];      ///< rotation; and couple z
  double shared_turn_off[4];  ///< rotation; last zero
};

/// One sphere of a clump, and the vector from the clump's centre of mass to its centre [m].
struct MemberStiffness {
  const OwnStiffness* own;
  std::array<double, 3> arm;
};

/// An upper bound of the largest eigenvalue of M^-1 K of a sphere, by its shares [1/s^2] ([1/s]
/// where k is of dashpots). Couple: sum of the shares of c_s r n, n away from its centre. Inverse
/// mass [1/kg], inverse moment of inertia [1/(kg m^2)].
double OwnRate(const OwnStiffness& k, double inverse_mass, double inverse_inertia);

/// An upper bound of the largest eigenvalue of M^-1 K of a clump of spheres, by the shares of its
/// members [1/s^2] ([1/s] where they are of dashpots). inverse_mass [1/kg]; inverse_inertia: of the
/// clump's smallest moment [1/(kg m^2)].
double OwnRate(std::span<const MemberStiffness> members, double inverse_mass,
               double inverse_inertia);

/// Rates of all bodies together, as bounds from above: the largest of OwnRate.
struct FastestRates {
  double spring = 0;   ///< square of the angular frequency [1/s^2] >= 0
  double dashpot = 0;  ///< rate of what dashpots slow [1/s] >= 0
};

/// The step dt at which (1 + d)(spring dt^2 + 2 dashpot dt) = 4 [s]; infinite where nothing holds.
/// Leapfrog is stable below it where forces take the velocities of half a step before and local
/// damping d (0 .. 1) makes those that slow a body down 1 + d times as large (one oscillator:
/// StableStep.* by simulation).
double StableStep(const FastestRates& rates, double local_damping);

}  // namespace calib::dem
