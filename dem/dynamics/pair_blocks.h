#pragma once
// Between grains and blocks of contacts: what a block of listed pairs needs of its grains, and
// where its loads go. The listed pairs are cut into blocks of kBlock lanes once per search; their
// memory stays in place as long as the list holds.

#include <cstdint>
#include <vector>

#include "dem/contact/contact_block.h"
#include "dem/dynamics/grain_load.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// A grain as contacts read it: three vector registers from neighbouring addresses. SI units.
struct alignas(32) GrainRecord {
  double at[4];        ///< centre, radius
  double velocity[4];  ///< peculiar; last zero
  double spin[4];      ///< angular velocity, radius
};

/// Records of grains [begin, end).
void PackGrains(const ParticleArrays& particles, int begin, int end, GrainRecord* records);

/// Listed pairs, lane by lane; padded to whole blocks with copies of the first pair of the last
/// block, whose loads go to a place that nobody reads.
struct PairLanes {
  std::vector<int> first, second;     ///< grains i and j
  std::vector<int> place_i, place_j;  ///< where loads go
  std::vector<std::uint8_t> image;    ///< ImageCode of the cell that j is seen in

  [[nodiscard]] int blocks() const { return static_cast<int>(first.size()) / kBlock; }
};

/// Columns of lanes that contacts remember, aligned as blocks are.
struct alignas(64) LaneColumn {
  double lane[kBlock];
};
using LaneMemory = std::vector<LaneColumn>;

/// The translation of each image; the last element of each zero.
using ImageShift = double[4];

/// Sets dx .. dz of all lanes of block `b` and says whether any two grains of it overlap.
bool LoadBranches(const PairLanes& lanes, int b, const GrainRecord* grains, const ImageShift* shift,
                  ContactBlock& block);

/// Sets radii and velocities of all lanes.
void LoadGrains(const PairLanes& lanes, int b, const GrainRecord* grains, ContactBlock& block);

/// Sums over contacts, kept in lanes until the end so that every compiler adds them in one order:
/// f_x d_x, f_y d_y, f_z d_z, f_x d_z + f_z d_x [N m].
struct alignas(32) LaneSums {
  double at[4][4] = {};
};

/// Which of the lanes act: those that overlap, and those that were formed and that a kernel holds
/// at a gap below `reach` [m]. Sets touching (kBlock of them) and returns how many overlap; lanes
/// from `count` on never act. Where not all act, forces, torques and memory (the first `width`
/// columns) of those that do not become zero.
int CloseBlock(int count, double reach, int width, ContactBlock& block, std::uint8_t* touching);

/// Leaves the loads of all lanes at their places and adds to the sums.
void StoreLoads(const PairLanes& lanes, int b, const ContactBlock& block, GrainLoad* loads,
                LaneSums& sums);

/// Sums the loads at the places of grains [begin, end), in ascending order, into fx .. tz.
void GatherPlaces(const int* place_row, const GrainLoad* loads, int begin, int end,
                  ParticleArrays& particles);

}  // namespace calib::dem
