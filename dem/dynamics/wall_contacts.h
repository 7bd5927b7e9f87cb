#pragma once
// Contacts of grains with walls: which touch, what they remember, what they do.

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "dem/contact/contact_block.h"
#include "dem/dynamics/contact_model.h"
#include "dem/dynamics/grain_load.h"
#include "dem/geometry/wall.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// Walls and their contacts. A grain has one contact with a plane that it overlaps and one for each
/// local minimum of the distance from its centre to a mesh: a face counts once, an edge or corner
/// that triangles share counts once, and not where one of them is nearer elsewhere. A contact that
/// rolls from one triangle to the next keeps what it remembers. Copyable: a copy goes on to the
/// same bits. Not thread-safe; Evaluate() uses threads inside.
class WallContacts {
 public:
  /// Contacts that one grain may have with walls [-]. Chosen: a grain in the corner of a box has
  /// three; one that has more than these ends the run.
  static constexpr int kMost = 8;

  explicit WallContacts(std::vector<Wall> walls = {}) : walls_(std::move(walls)) {}

  [[nodiscard]] bool empty() const { return walls_.empty(); }
  [[nodiscard]] const std::vector<Wall>& walls() const { return walls_; }
  /// Velocities, activity and friction may be set between steps; places change by Move() only.
  std::vector<Wall>& mutable_walls() { return walls_; }

  /// Sets the material of all walls, an index in Materials; 0, the model's own, unless set.
  void SetMaterial(int material) { material_ = material; }

  /// Lists what each grain may touch until grains and walls have moved by `skin` together; what
  /// contacts remember goes along.
  void Search(const ParticleArrays& particles, double skin);

  /// Moves all walls on by dt [s].
  void Move(double dt);

  /// Largest displacement of any wall since the search [m].
  [[nodiscard]] double moved() const { return moved_; }

  /// What all contacts of a step have in common.
  struct Step {
    double dt = 0;
    bool viscous = true;
    double reach = 0;  ///< gap up to which formed contacts may act [m]
    double moved = 0;  ///< largest displacement of any grain since the search [m]; cells with walls
                       ///< do not strain
    int threads = 1;
  };

  /// Forces of the present configuration. Errors: OUT_OF_RANGE naming the grain that touches more
  /// than kMost places of walls at once.
  absl::Status Evaluate(const ParticleArrays& particles, const ContactModel& model,
                        const Step& step);

  /// Adds the loads of the last Evaluate to the grains' forces and torques, for grains of [begin,
  /// end).
  void AddLoads(int begin, int end, ParticleArrays& particles) const;

  /// Force of the grains on a wall in the last Evaluate [N].
  [[nodiscard]] Vec3 ForceOn(int wall) const { return force_[static_cast<std::size_t>(wall)]; }

  /// Number of contacts of the last Evaluate.
  [[nodiscard]] std::int64_t contacts() const { return contacts_; }

  /// Calls visit(block, grains) for blocks of the present contacts without moving them on: lane k
  /// is of grain grains[k].
  template <class Visitor>
  void VisitBlocks(const ParticleArrays& particles, const ContactModel& model, bool viscous,
                   const Visitor& visit) const;

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(walls_, searched_, moved_, rows_, candidates_, slots_, force_, contacts_);
  }

  /// Gives grains new indices: grain q becomes to[q]; -1: it is taken out. To be followed by
  /// Search.
  void Renumber(const std::vector<int>& to);

 private:
  struct Contact {
    int wall = 0;
    Vec3 point{};  ///< nearest point of the wall
    double history[kMaxHistory] = {};
  };
  struct Candidate {
    int wall = 0;
    int triangle = -1;    ///< -1: a plane
    double distance = 0;  ///< of the grain's centre at the search [m]
  };
  /// A grain that may touch walls. Its contacts have the slots of its candidates, which are as many
  /// or more.
  struct Row {
    int grain = 0;
    int first = 0;  ///< candidate
    int contacts = 0;
    GrainLoad load{};
  };
  struct ChunkResult {
    std::vector<Vec3> force;  ///< per wall
    std::int64_t contacts = 0;
    int crowded = -1;  ///< grain with too many contacts
  };

  void FindContacts(const ParticleArrays& p, const Step& step, std::size_t row,
                    ChunkResult& result);
  [[nodiscard]] Contact& ContactOf(const Row& row, int k) {
    return slots_[static_cast<std::size_t>(row.first) + static_cast<std::size_t>(k)];
  }
  [[nodiscard]] const Contact& ContactOf(const Row& row, int k) const {
    return slots_[static_cast<std::size_t>(row.first) + static_cast<std::size_t>(k)];
  }
  void EvaluateChunk(const ParticleArrays& p, const ContactModel& model, const Step& step,
                     int chunk, ChunkResult& result);
  void LoadLane(const ParticleArrays& p, const ContactModel& model, const Row& row,
                const Contact& contact, ContactBlock& block) const;
  /// tan(phi_w) of a contact with a wall [-]. pair: Materials::Pair() of grain and wall, where the
  /// model has several materials.
  [[nodiscard]] double FrictionOf(int wall, const ContactModel& model, int pair) const;
  [[nodiscard]] int PairOf(const ParticleArrays& p, int grain, const ContactModel& model) const {
    return model.materials() == nullptr
               ? 0
               : model.materials()->Pair(p.material[static_cast<std::size_t>(grain)], material_);
  }
  [[nodiscard]] Vec3 NearestOn(const Candidate& candidate, const Vec3& p) const;

  std::vector<Wall> walls_;
  int material_ = 0;
  std::vector<std::vector<Vec3>> searched_;  ///< vertices at the search; a plane's point
  double moved_ = 0;
  std::vector<Row> rows_;  ///< ascending by grain
  std::vector<Candidate> candidates_;
  std::vector<Contact> slots_;      ///< per candidate; the first `contacts` of each row are in use
  std::vector<Row> old_rows_;       ///< of the search before; its memory is used again
  std::vector<Contact> old_slots_;  ///< of the search before; its memory is used again
  std::vector<ChunkResult> results_;
  std::vector<Vec3> force_;
  std::int64_t contacts_ = 0;
};

template <class Visitor>
void WallContacts::VisitBlocks(const ParticleArrays& particles, const ContactModel& model,
                               bool viscous, const Visitor& visit) const {
  ContactBlock block;
  block.wall = true;
  block.mass_factor = 2;
  block.viscous = viscous ? 1.0 : 0.0;
  int grains[kBlock];
  const auto flush = [&] {
    if (block.count > 0) {
      PadLanes(model.history_size(), block);
      model.Evaluate(block);
      visit(block, grains);
      block.count = 0;
    }
  };
  for (const Row& row : rows_) {
    for (int c = 0; c < row.contacts; ++c) {
      grains[block.count] = row.grain;
      LoadLane(particles, model, row, ContactOf(row, c), block);
      if (block.count == kBlock) {
        flush();
      }
    }
  }
  flush();
}

}  // namespace calib::dem
