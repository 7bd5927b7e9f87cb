#pragma once
// What the stiffnesses of contacts add up to at their grains: the terms of EstimateStiffness, block by
// block and chunk by chunk, so that chunks may be taken by several threads.

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "dem/contact/contact_block.h"
#include "dem/dynamics/pair_blocks.h"
#include "dem/dynamics/stable_step.h"

namespace calib::dem {

/// Of a chunk of pairs, at its places: what springs hold its grains by; of dashpots the same per rate.
struct ChunkStiffness {
  std::vector<OwnStiffness> spring;
  std::vector<OwnStiffness> dashpot;            ///< empty where none acts
  std::array<double, 3> modulus = {0, 0, 0};    ///< sum of stiffness times squared branch [N m]
  std::array<double, 3> viscosity = {0, 0, 0};  ///< the same of dashpots [N m s]
  double rolling = 0;                           ///< sum over contacts [N m/rad]
  double twisting = 0;
  int too_deep = -1;         ///< first slot that overlaps by more than half the smaller radius
  double deepest_there = 0;  ///< its overlap [m]

  /// As new, but with the memory it has.
  void Clear() {
    std::vector<OwnStiffness> rows[2] = {std::move(spring), std::move(dashpot)};
    *this = {};
    spring = std::move(rows[0]);
    dashpot = std::move(rows[1]);
    spring.clear();
    dashpot.clear();
  }
};

/// Adds the lanes of block `b` that touch; the block's stiffnesses are set. places: of the chunk.
void AddStiffness(const PairLanes& lanes, int b, const ContactBlock& block,
                  const std::uint8_t* touching, int places, ChunkStiffness& chunk);

}  // namespace calib::dem
