#pragma once
// Spheres of one clump move as one rigid body: translation of its centre of mass, rotation by
// quaternions.

#include <array>
#include <vector>

#include "dem/dynamics/leapfrog.h"
#include "dem/dynamics/stable_step.h"
#include "dem/geometry/periodic_cell.h"
#include "dem/geometry/vector3.h"
#include "dem/particles/packing.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// One rigid body. Vectors in the axes of the cell.
struct Clump {
  std::vector<int> members;               ///< indices in the arrays, ascending
  double mass = 0;                        ///< of the union of its spheres [kg]
  double volume = 0;                      ///< of the union [m^3]
  std::array<double, 3> inertia{};        ///< principal moments [kg m^2], > 0
  std::array<double, 3> centre{};         ///< of mass, not wrapped [m]
  std::array<double, 3> velocity{};       ///< peculiar, at half steps [m/s]
  std::array<double, 3> momentum{};       ///< angular, at half steps [kg m^2/s]
  std::array<double, 4> orientation{};    ///< unit quaternion (w, x, y, z): principal to cell axes
  std::vector<std::array<double, 3>> at;  ///< centres of the members, principal axes [m]
  std::vector<std::array<double, 3>>
      arm;  ///< centres of the members from the body's, cell axes, now [m]
  std::vector<std::array<int, 3>> image;  ///< whole lattice vectors between member and body

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(members, mass, volume, inertia, centre, velocity, momentum, orientation, at, arm,
            image);
  }
};

/// What the clumps of an assembly are made of.
struct ClumpMatter {
  double density = 0;   ///< [kg/m^3] > 0
  bool planar = false;  ///< they turn about y only; centres of members in one plane y
  double thickness =
      0;  ///< planar: of disks, of which each body has two equal ones [m]; 0: spheres
};

/// Clumps of an assembly; none where every grain is a sphere of its own. Mass and inertia are those
/// of the union, so that overlapping members count once. Leapfrog: forces and momenta at half
/// steps, orientation by the angular velocity at mid-step, with rational rotations (Cayley), so
/// that the same bits come out on every processor. Not thread-safe; Advance() uses threads inside.
/// [Fincham 1992, Mol. Simul. 8, 165]
class RigidClumps {
 public:
  RigidClumps() = default;

  /// Takes the clumps of the packing (two and more spheres of one id) and gives their members the
  /// mass and the smallest moment of the body. particles: MakeParticles of the packing. Members lie
  /// at the images nearest to their first.
  RigidClumps(const Packing& packing, const ClumpMatter& matter, ParticleArrays& particles);

  /// Adds one clump of the particles at these indices, ascending, which belong to no clump, in a
  /// cell of these three lengths [m]. It does not turn yet and has the velocity of its first
  /// member. Precondition: particles.body is as long as the other arrays.
  void Add(const std::vector<int>& members, const double* length, const ClumpMatter& matter,
           ParticleArrays& particles);

  [[nodiscard]] bool empty() const { return clumps_.empty(); }
  [[nodiscard]] const std::vector<Clump>& all() const { return clumps_; }
  std::vector<Clump>& mutable_all() { return clumps_; }

  /// One step under the members' loads (fx .. tz of the particles) and the weight of the bodies,
  /// gravity [m/s^2], with local damping and drag. Places members and gives them velocities such
  /// that their displacement is exactly that of the body. Afterwards the body's loads stand at its
  /// first member and zero at the others. cell: after its own step.
  void Advance(const Motion& motion, const Vec3& gravity, const PeriodicCell& cell, int threads,
               ParticleArrays& particles);

  /// Remembers where wrapping has put the members. To be called after each search.
  void Rewrap(const PeriodicCell& cell, const ParticleArrays& particles);

  /// New indices of the members, < 0 for those that leave; whole clumps leave. body: the clump of
  /// each sphere by its old index, renumbered with them.
  void Renumber(const std::vector<int>& to, std::vector<int>& body);

  /// Adds up, at the first member of each clump, what holds its members when all other bodies stay
  /// (translation and rotation of OwnStiffness, not the shares): translations add up, rotations
  /// gain what translation does on the arms.
  void Fold(std::vector<OwnStiffness>& stiffness) const;

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(clumps_);
  }

 private:
  std::vector<Clump> clumps_;
};

}  // namespace calib::dem
