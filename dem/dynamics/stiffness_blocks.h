#pragma once
// What the stiffnesses of contacts add up to at their grains: the terms of EstimateStiffness, block
// by block and chunk by chunk, so that chunks may be taken by several threads.

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "dem/contact/contact_block.h"
#include "dem/dynamics/pair_blocks.h"
#include "dem/dynamics/stable_step.h"

namespace calib::dem {

/// What the contacts of a chunk of pairs hold its grains by, one element per place of the chunk,
/// springs and dashpots apart.
struct ChunkStiffness {
  std::vector<OwnStiffness> spring;
  std::vector<OwnStiffness> dashpot;            ///< per rate; empty where no dashpot acts
  std::array<double, 3> modulus = {0, 0, 0};    ///< sum of stiffness times squared branch [N m]
  std::array<double, 3> viscosity = {0, 0, 0};  ///< sum of damping times squared branch [N m s]
  double rolling = 0;        ///< sum of rolling stiffness over contacts [N m/rad]
  double twisting = 0;       ///< sum of twisting stiffness over contacts [N m/rad]
  int too_deep = -1;         ///< first slot that overlaps by more than half the smaller radius
  double deepest_there = 0;  ///< overlap of slot too_deep [m]

  /// Makes it as new, but keeps the memory of its vectors.
  void Clear() {
    std::vector<OwnStiffness> rows[2] = {std::move(spring), std::move(dashpot)};
    *this = {};
    spring = std::move(rows[0]);
    dashpot = std::move(rows[1]);
    spring.clear();
    dashpot.clear();
  }
};

/// Adds to `chunk` what the lanes that touch do, of `block`, which is block `b` of the lanes.
/// places: number of places of the chunk. Precondition: the block's stiffnesses are set.
void AddStiffness(const PairLanes& lanes, int b, const ContactBlock& block,
                  const std::uint8_t* touching, int places, ChunkStiffness& chunk);

}  // namespace calib::dem
