#pragma once
// Which grains may touch until the next search: a Verlet list in CSR order, found with a cell grid.

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "dem/geometry/periodic_cell.h"
#include "dem/neighbor/cell_grid.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// Pairs (i, j), i < j, sorted by i then j; a pair's index is its slot. Every pair appears once,
/// with the image of j that is nearest to i.
struct NeighborList {
  double skin = 0;                  ///< pairs are listed up to this gap between surfaces [m]
  std::vector<int> row;             ///< CSR: slots of grain i are row[i] .. row[i+1]-1; size N+1
  std::vector<int> first, second;   ///< grains i and j of a slot
  std::vector<std::uint8_t> image;  ///< ImageCode of the cell that j is seen in

  [[nodiscard]] int size() const { return static_cast<int>(second.size()); }
};

/// Finds lists of neighbours. Keeps the memory of a search for the next one, so that flows, which
/// search every few dozen steps, ask for none. Not thread-safe.
class NeighborSearch {
 public:
  /// Wraps all centres into the cell along its periodic axes (its tilt at most half of Lx) and
  /// lists every pair with |x_j - x_i| < r_i + r_j + skin that is not of one clump. Errors:
  /// OUT_OF_RANGE when a centre is not finite or the cell has become shorter than two interaction
  /// ranges (pairs would have several images); list and positions are then unusable.
  absl::Status Build(const PeriodicCell& cell, double skin, ParticleArrays& particles,
                     NeighborList& list);

 private:
  /// A grain as the search reads it, in the order of the grid.
  struct GridGrain {
    double x, y, z, radius;
    int index;
  };
  /// Grain j and the image it is seen in, in one number that sorts by j.
  using Neighbor = std::uint64_t;

  /// Writes the grains of `run` that are near `self` to `end` and on; returns the new end.
  static Neighbor* AppendNear(const GridGrain& self, double skin, const double (&shift)[3],
                              int code, std::span<const GridGrain> run, Neighbor* end);

  CellGrid grid_;
  std::vector<GridGrain> grains_;
  std::vector<GridRun> around_;
  std::vector<Neighbor> found_;
};

}  // namespace calib::dem
