#pragma once
// All grains of one specimen with their contacts, in the periodic cell or between walls, and one
// explicit time step of them.

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "dem/dynamics/contact_model.h"
#include "dem/dynamics/leapfrog.h"
#include "dem/dynamics/pair_blocks.h"
#include "dem/dynamics/rigid_clumps.h"
#include "dem/dynamics/stable_step.h"
#include "dem/dynamics/stiffness_blocks.h"
#include "dem/dynamics/wall_contacts.h"
#include "dem/geometry/periodic_cell.h"
#include "dem/neighbor/neighbor_list.h"
#include "dem/particles/packing.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// Stiffness of all contacts as the choice of the time step and the servo need it.
struct StiffnessEstimate {
  FastestRates fastest;  ///< of all bodies together; zero without contacts
  double critical_step =
      0;  ///< min over grains and axes of sqrt(m/K), translation and rotation [s]; 0: no contact
  double elastic_step = 0;    ///< critical_step if there were no dashpots [s]
  double step_by_forces = 0;  ///< critical_step without dashpots and moment stiffness [s]
  bool by_twisting = false;   ///< contacts are stiffer in twisting than in rolling
  std::array<double, 3> modulus = {0, 0, 0};  ///< affine (Voigt) stiffness of each axis [Pa]
  std::array<double, 3> viscosity = {0, 0,
                                     0};  ///< affine viscosity of each axis by dashpots [Pa s]
};

/// What surrounds the grains where it is not a periodic cell.
struct Surroundings {
  bool open[3] = {true, true, true};  ///< axes without images (PeriodicCell::open)
  Vec3 gravity{};                     ///< [m/s^2]
  std::vector<Wall> walls{};          ///< in a periodic axis they reach a diameter beyond the cell
  bool planar = false;                ///< grains move in the plane of x and z only
  double thickness = 0;               ///< of disks, planar only [m]; 0: the grains are spheres
  std::string material{};             ///< name of the walls' material; "": the model's own
  double skin = 0.25;  ///< gap up to which pairs are listed, over the mean diameter [-] > 0.
                       ///< Chosen: flows search less often with a wide one
};

/// A grain that joins others.
struct NewGrain {
  Vec3 centre{}, velocity{};  ///< [m], [m/s]
  double radius = 0;          ///< [m] > 0
  int material = 0;           ///< index in Materials
  int clump = -1;  ///< >= 0: one rigid body with the grains of this number that join in the
                   ///< same call; -1: a sphere of its own
};

/// Grains, contacts and cell of one specimen. Copyable: a copy is a snapshot that goes on to the
/// same bits. Not thread-safe; uses `threads` threads inside.
class Assembly {
 public:
  /// A specimen in its periodic cell, at rest. Spheres of one clump id move as one rigid body.
  /// density: of the grains [kg/m^3] > 0. Preconditions: the packing has grains; threads >= 1.
  Assembly(const Packing& packing, double density, ContactModel model, int threads);

  /// Grains at rest with gravity and walls around them; `packing.length` only says where they
  /// usually are along open axes, 0 .. length. Grains of these sizes may join later. density: of
  /// the grains [kg/m^3] > 0. Preconditions: the packing has grains; threads >= 1.
  Assembly(const Packing& packing, double density, ContactModel model, Surroundings surroundings,
           int threads);

  /// Takes out the grains at these indices of particles(), ascending. To be followed by
  /// EvaluateForces. Precondition: all spheres of a clump are taken out, or none.
  void Remove(const std::vector<int>& grains);

  /// Lets grains join, with the next free ids. To be followed by EvaluateForces. Preconditions: no
  /// radius is larger than the largest that the assembly was made with; spheres of one clump follow
  /// one another, have one velocity and the model's own material.
  void Insert(const std::vector<NewGrain>& grains);

  /// Takes a clump (index in clumps().all()) out of its contacts and sets it down at rest, farther
  /// by `shift` [m]. To be followed by EvaluateForces.
  void Relocate(int clump, const Vec3& shift);

  /// Walls and their contacts. Velocities, activity and friction of walls may be set between steps.
  [[nodiscard]] const WallContacts& walls() const { return walls_; }
  std::vector<Wall>& mutable_walls() { return walls_.mutable_walls(); }

  /// Lets the next EvaluateForces search neighbours anew. To be called after a wall was opened or
  /// placed by hand.
  void SearchAgain() { stale_ = true; }

  /// Contact forces, torques and stress of the present configuration; searches neighbours first
  /// when the list may miss a pair. To be called once after every Move. Errors: OUT_OF_RANGE naming
  /// the grain or the axis (see NeighborSearch).
  absl::Status EvaluateForces();

  /// One leapfrog step of grains and cell under the loads of the last EvaluateForces. Precondition:
  /// no grain has joined or left since.
  void Move(const Motion& motion);

  /// Sets one cell length exactly, after a Move that reached it up to rounding.
  void SetLength(int axis, double length) { cell_.length[axis] = length; }

  /// Sets the displacement of the top along x [m] exactly, after a Move that reached it up to
  /// rounding.
  void SetDisplacement(double displacement) { cell_.displacement = displacement; }

  /// Stiffnesses of the present contacts; their memory is not touched. Errors: OUT_OF_RANGE when
  /// two grains overlap by more than half the smaller radius: the model is too soft for the stress.
  [[nodiscard]] absl::Status EstimateStiffness(StiffnessEstimate& estimate);

  /// Critical step of two touching grains of the smallest size at an overlap of 1e-4 radii [s]:
  /// bounds the step where contacts are few or about to form.
  [[nodiscard]] double NominalCriticalStep() const { return nominal_critical_step_; }

  /// The fastest rates of two touching grains of the smallest size at an overlap of 1e-4 radii.
  [[nodiscard]] const FastestRates& NominalRates() const { return nominal_rates_; }

  /// Critical step of two touching grains of the smallest size at an overlap in radii [-] > 0 [s].
  [[nodiscard]] double CriticalStepAt(double overlap) const;

  /// How many times shorter the step is than without the moment stiffness of contacts, which are
  /// taken for no softer than at an overlap of 1e-4 radii [-].
  [[nodiscard]] double MomentDelay(const StiffnessEstimate& estimate) const;

  /// What MomentDelay() finds, in words that name the effect.
  [[nodiscard]] std::string MomentStepText(const StiffnessEstimate& estimate) const;

  /// Largest MomentDelay() with which a run goes on [-]. Chosen: the 200 000 steps in which a
  /// specimen has to settle (StageOptions) are beyond it fewer than 70 of those that the forces
  /// would allow.
  static constexpr double kLongestMomentDelay = 3000;

  /// Mean net force of the loaded grains over mean contact force [-]; 0 without contacts, infinite
  /// when not finite.
  [[nodiscard]] double UnbalancedForce() const;

  /// Acceleration of free fall; zero in a periodic cell [m/s^2].
  [[nodiscard]] Vec3 gravity() const { return gravity_; }

  /// The first grain whose net force is not a number, in words; empty: there is none.
  [[nodiscard]] std::string FirstNotFinite() const;

  /// Whether viscous effects act; they do until told otherwise.
  void SetViscous(bool viscous) { viscous_ = viscous; }

  /// tan(phi_mu) between grains [-] >= 0, in place of the model's until set again.
  void SetSlidingFriction(double friction) { sliding_friction_ = friction; }
  [[nodiscard]] double sliding_friction() const { return sliding_friction_; }
  [[nodiscard]] const ContactModel& model() const { return model_; }
  [[nodiscard]] const PeriodicCell& cell() const { return cell_; }
  [[nodiscard]] const ParticleArrays& particles() const { return particles_; }
  [[nodiscard]] const NeighborList& neighbors() const { return list_; }
  /// Whether the two grains of a slot of neighbors() are in contact.
  [[nodiscard]] bool touching(int slot) const {
    return touching_[static_cast<std::size_t>(slot)] != 0;
  }

  /// Force that the contact of a slot of neighbors() puts on its grain j [N]; zero where the two
  /// grains do not touch.
  [[nodiscard]] Vec3 force_on_j(int slot) const {
    const BlockForces& f = forces_[static_cast<std::size_t>(slot) / kBlock];
    const std::size_t lane = static_cast<std::size_t>(slot) % kBlock;
    return {f.x[lane], f.y[lane], f.z[lane]};
  }

  /// Love-Weber stress sum_c f_a d_a / V of the last EvaluateForces, compression positive [Pa].
  [[nodiscard]] const std::array<double, 3>& stress() const { return stress_; }
  /// Minus the component xz (mean of xz and zx) of the Love-Weber stress: positive when the top is
  /// sheared along +x [Pa].
  [[nodiscard]] double shear_stress() const { return shear_stress_; }
  /// Number of contacts between grains; contacts with walls are counted by walls().
  [[nodiscard]] std::int64_t contacts() const { return contacts_; }
  /// Number of bodies: single spheres and clumps.
  [[nodiscard]] int bodies() const { return bodies_; }
  [[nodiscard]] const RigidClumps& clumps() const { return clumps_; }
  RigidClumps& mutable_clumps() { return clumps_; }

  /// Makes grains (index, new radius [m]) smaller; the solid volume stays what it was. Forces
  /// follow at the next evaluation. Precondition: single spheres, no radius grows.
  void Shrink(const std::vector<std::pair<int, double>>& radii);

  /// Sum of the volumes of grains, unions for clumps, of the packing as it was given, less what
  /// Remove() took out, with what Insert() put in [m^3].
  [[nodiscard]] double solid_volume() const { return solid_volume_; }
  /// Mean diameter of the spheres that have the volumes of the bodies [m].
  [[nodiscard]] double mean_diameter() const { return mean_diameter_; }
  /// Number of calls of Move().
  [[nodiscard]] std::int64_t steps() const { return steps_; }
  /// Sum over evaluations of the number of contacts.
  [[nodiscard]] std::int64_t contact_updates() const { return contact_updates_; }

  /// Everything that determines what follows, but the model and the number of threads, for archives
  /// (dynamics/archive.h).
  template <class Archive>
  void Visit(Archive& archive) {
    ParticleArrays& p = particles_;
    packed_ = false;
    archive(cell_, p.x, p.y, p.z, p.vx, p.vy, p.vz, p.wx, p.wy, p.wz, p.fx, p.fy, p.fz, p.tx, p.ty,
            p.tz, p.radius, p.inverse_mass, p.inverse_inertia, p.id, p.body);
    archive(sliding_friction_, viscous_, gravity_, density_, thickness_, next_id_, planar_, walls_,
            stale_, loads_fit_, reach_, wall_reach_, last_dt_);
    archive(list_.skin, list_.row, list_.first, list_.second, list_.image, order_, lanes_.first,
            lanes_.second, lanes_.place_i, lanes_.place_j, lanes_.image, records_);
    archive(searched_[0], searched_[1], searched_[2], searched_length_, searched_tilt_, moved_,
            skin_, largest_radius_, touching_, history_, places_, forces_, shift_, sums_, stress_,
            shear_stress_, contacts_);
    archive(clumps_, bodies_, solid_volume_, mean_diameter_, nominal_critical_step_,
            nominal_rates_.spring, nominal_rates_.dashpot, steps_, contact_updates_);
    if (model_.materials() != nullptr) {
      archive(p.material);
    }
  }

  /// Places and drives single grains by hand; for tests and for preparing states. Asked for anew
  /// where grains are changed between a Move and the EvaluateForces after it.
  ParticleArrays& mutable_particles() {
    packed_ = false;
    return particles_;
  }

 private:
  struct ChunkSums {
    LaneSums lanes;
    std::int64_t contacts = 0;
  };

  absl::Status SearchNeighbors();
  void ArrangeLanes();
  void CarryMemory();
  void EvaluateChunk(int chunk);
  void PrepareBlock(ContactBlock& block) const;
  void TakeMaterials(const Packing& packing);
  [[nodiscard]] double DensityOf(int material) const;
  [[nodiscard]] ClumpMatter ClumpMatterOf(double density) const {
    return {.density = density, .planar = planar_, .thickness = thickness_};
  }
  [[nodiscard]] int MaterialOf(std::size_t grain) const {
    return particles_.material.empty() ? 0 : particles_.material[grain];
  }
  void LoadMaterials(int b, ContactBlock& block) const;
  void SetShifts();
  void PackAllGrains();
  void PackChunk(int chunk);
  [[nodiscard]] bool AnyTouching(int b) const;
  /// First column of block b in the memory.
  [[nodiscard]] std::size_t ColumnsOf(std::size_t b) const {
    return b * static_cast<std::size_t>(model_.history_size());
  }
  void AddSurroundings(int begin, int end);
  void Renumber(const std::vector<int>& to);
  void MoveChunk(int chunk, const Motion& motion);
  void FinishChunk(int chunk);
  [[nodiscard]] double LargestShift2OfChunk(int chunk) const;
  [[nodiscard]] bool ListMayMissPairs() const;
  [[nodiscard]] double ShearSinceSearch() const;
  void TakeBranchesBetweenBodies();
  void SumStiffnessOfChunk(int chunk, ChunkStiffness& stiffness) const;
  void SetStepsAlongAxes(StiffnessEstimate& estimate);
  [[nodiscard]] double FastestOf(const std::vector<OwnStiffness>& own) const;
  void SetNominalStep();
  [[nodiscard]] absl::Status FormulasFinite() const;
  /// What NominalCriticalStep() would be if contacts had no moment stiffness [s].
  [[nodiscard]] double NominalStepByForces() const;
  /// Calls visit with the smallest grain of each material and each pair of its material with
  /// another (pair 0 where the model has one material).
  void VisitSmallestGrains(const std::function<void(std::size_t grain, int pair)>& visit) const;
  /// The least critical step of two touching grains of the smallest size, over all pairs of
  /// materials [s]; overlap: in radii [-] > 0.
  [[nodiscard]] double LeastNominalStep(double overlap, bool with_moments) const;

  PeriodicCell cell_;
  ParticleArrays particles_;
  ContactModel model_;
  int threads_ = 1;
  double sliding_friction_ = 0;
  bool viscous_ = true;
  Vec3 gravity_;
  double density_ = 0;
  double thickness_ = 0;  ///< of disks [m]; 0: spheres
  int next_id_ = 0;
  bool planar_ = false;
  WallContacts walls_;
  bool stale_ = false;     ///< the list must be made anew
  bool loads_fit_ = true;  ///< loads are of the grains as they are numbered now
  double reach_ = 0;       ///< gap up to which formed contacts may act [m]
  double wall_reach_ = 0;  ///< reach_ at walls, whose r* is that of two grains twice as large [m]
  double last_dt_ = 0;

  NeighborList list_;
  std::array<std::vector<double>, 3> searched_;  ///< centres at the last search
  double searched_length_[3] = {0, 0, 0};
  double searched_tilt_ = 0;
  double moved_ = 0;  ///< largest non-affine displacement since the last search [m]
  double skin_ = 0;
  double largest_radius_ = 0;

  std::vector<int> order_;  ///< slots by (i, j); the list itself has those together that touch
  PairLanes lanes_;         ///< the list, padded to whole blocks
  std::vector<std::uint8_t> touching_;  ///< per lane
  LaneMemory history_;                  ///< per block, history_size() columns of kBlock lanes
  LoadPlaces places_;                   ///< what contacts do to grains
  std::vector<BlockForces> forces_;     ///< per block; zero where not touching
  std::vector<GrainRecord> records_;    ///< of the grains, at the last evaluation or Move
  bool packed_ = false;                 ///< records_ are those of the grains since the last Move
  std::vector<double> shift2_;          ///< largest of each chunk of grains, see moved_ [m^2]
  ImageShift shift_[kImages] = {};      ///< translation of each image now [m]
  std::vector<ChunkSums> sums_;
  std::array<double, 3> stress_ = {0, 0, 0};
  double shear_stress_ = 0;
  std::int64_t contacts_ = 0;

  /// What a search leaves for the next one: the list before it with what contacts remembered, and
  /// memory that is used again.
  struct Searching {
    NeighborSearch search;
    NeighborList old, sorted;
    std::vector<int> old_order;
    std::vector<std::uint8_t> group, old_touching;
    LaneMemory old_history;
  };
  Searching searching_;

  /// What an estimate of stiffness works in, kept from one to the next.
  struct Estimating {
    std::vector<ChunkStiffness> chunks;  ///< a few at a time
    std::vector<OwnStiffness> springs;   ///< per grain
    std::vector<OwnStiffness> dashpots;  ///< per grain; empty where no dashpot acts
  };
  Estimating estimating_;

  RigidClumps clumps_;
  int bodies_ = 0;
  double solid_volume_ = 0;
  double mean_diameter_ = 0;
  double nominal_critical_step_ = 0;
  FastestRates nominal_rates_;
  std::int64_t steps_ = 0;
  std::int64_t contact_updates_ = 0;
};

}  // namespace calib::dem
