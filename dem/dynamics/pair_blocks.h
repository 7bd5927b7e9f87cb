#pragma once
// Between grains and blocks of contacts: what a block of listed pairs needs of its grains, and
// where its loads go. The listed pairs are cut into blocks of kBlock lanes once per search; their
// memory stays in place as long as the list holds.

#include <cstdint>
#include <span>
#include <vector>

#include "dem/contact/contact_block.h"
#include "dem/dynamics/grain_load.h"
#include "dem/geometry/vector3.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// A grain as contacts read it: three vector registers from neighbouring addresses. SI units.
struct alignas(32) GrainRecord {
  double at[4];        ///< centre [m], radius [m]
  double velocity[4];  ///< peculiar velocity [m/s], zero
  double spin[4];      ///< angular velocity [rad/s], radius [m]
};

/// Writes the records of grains [begin, end) to records[begin] .. records[end - 1].
void PackGrains(const ParticleArrays& particles, int begin, int end, GrainRecord* records);

/// Listed pairs, lane by lane; padded to whole blocks with copies of the first pair of the last
/// block, which never act.
struct PairLanes {
  std::vector<int> first, second;               ///< grains i and j
  std::vector<std::uint16_t> place_i, place_j;  ///< places of i and j among those of the chunk
  std::vector<std::uint8_t> image;              ///< ImageCode of the cell that j is seen in

  /// Number of blocks of kBlock lanes.
  [[nodiscard]] int blocks() const { return static_cast<int>(first.size()) / kBlock; }
};

/// Where pairs leave what they do to grains. Every chunk of kPairChunk pairs has one place for each
/// grain that it touches, side by side, so that loads are added up in the first-level cache; a
/// grain then gathers its few places. Thread-safe as far as threads Clear() and
/// fill different chunks, or Gather() different grains; otherwise not thread-safe.
class LoadPlaces {
 public:
  /// Makes the places for `grains` grains and sets place_i and place_j of the lanes; all loads are
  /// zero.
  void Assign(int grains, PairLanes& lanes);

  /// Sets the loads at the places of a chunk to zero; returns the first of them.
  GrainLoad* Clear(int chunk);

  /// Sums the loads of grains [begin, end) over their places, in ascending order of chunks, into
  /// fx .. tz. Precondition: begin is a multiple of four.
  void Gather(int begin, int end, ParticleArrays& particles) const;

  /// The grain of each place of a chunk.
  [[nodiscard]] std::span<const int> GrainsOf(int chunk) const {
    const auto c = static_cast<std::size_t>(chunk);
    return {grain_of_.data() + chunk_row_[c], grain_of_.data() + chunk_row_[c + 1]};
  }

  /// Sum of the forces on one grain over its places, in ascending order of chunks [N].
  [[nodiscard]] Vec3 ForceOn(int grain) const;

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(chunk_row_, grain_of_, row_, place_, load_);
  }

 private:
  std::vector<int> chunk_row_;  ///< CSR over chunks: their places
  std::vector<int> grain_of_;   ///< of each place
  std::vector<int> row_;        ///< CSR over fours of grains: what place_ has of them
  std::vector<int> place_;      ///< of four grains in turn, those that have fewer with the last one
  std::vector<GrainLoad> load_;  ///< of all places, and one more that stays zero

  /// What is known of a grain while places are assigned: the last chunk that met it, its place
  /// there, and how many chunks have met it.
  struct Met {
    int chunk, place, count;
  };
  std::vector<Met> met_;
};

/// Forces on grains j of a block [N].
struct alignas(64) BlockForces {
  double x[kBlock], y[kBlock], z[kBlock];
};

/// Columns of lanes that contacts remember, aligned as blocks are.
struct alignas(64) LaneColumn {
  double lane[kBlock];
};
using LaneMemory = std::vector<LaneColumn>;

/// Translation of one periodic image [m]; the fourth element is zero.
using ImageShift = double[4];

/// Sets dx .. dz of all lanes of `block`, which is block `b` of the lanes; returns whether any two
/// of its grains overlap. shift: one per image code.
bool LoadBranches(const PairLanes& lanes, int b, const GrainRecord* grains, const ImageShift* shift,
                  ContactBlock& block);

/// Sets radii and velocities of all lanes of `block`, which is block `b` of the lanes.
void LoadGrains(const PairLanes& lanes, int b, const GrainRecord* grains, ContactBlock& block);

/// Sums over contacts of f_x d_x, f_y d_y, f_z d_z, f_x d_z + f_z d_x [N m], force times branch
/// vector, kept in four partial sums each until the end so that every compiler adds them in one
/// order.
struct alignas(32) LaneSums {
  double at[4][4] = {};
};

/// Decides which of the lanes act: those that overlap, and those that were formed and that a kernel
/// holds at a gap below `reach` [m]. Sets touching (kBlock of them) and returns how many overlap;
/// lanes from `count` on never act. Where not all act, forces, torques and memory (the first
/// `width` columns) of those that do not become zero.
int CloseBlock(int count, double reach, int width, ContactBlock& block, std::uint8_t* touching);

/// Adds the loads of all lanes of `block`, which is block `b` of the lanes, to those at their
/// places, which begin at `loads`; writes the forces on grains j to `forces` and adds to `sums`.
void AddLoads(const PairLanes& lanes, int b, const ContactBlock& block, GrainLoad* loads,
              BlockForces& forces, LaneSums& sums);

}  // namespace calib::dem
