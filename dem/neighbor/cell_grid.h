#pragma once
// Grains sorted into a regular grid over the periodic cell.

#include <array>
#include <vector>

#include "dem/geometry/periodic_cell.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// A neighbouring grid cell and the shift of the periodic image it is seen in.
struct GridNeighbor {
  int cell = 0;
  int shift[3] = {0, 0, 0};
};

class CellGrid {
 public:
  /// Sorts wrapped centres (0 <= z < Lz, 0 <= x - z tilt/Lz < Lx; anywhere along open axes) into
  /// grid cells of at least `range` [m] > 0 per edge; in a sheared cell the edges along x follow
  /// its tilt and are longer.
  CellGrid(const PeriodicCell& cell, const ParticleArrays& particles, double range);

  /// Grains of one grid cell in ascending order: grains()[begin(c)] .. grains()[begin(c + 1) - 1].
  [[nodiscard]] int begin(int cell) const { return begin_[static_cast<std::size_t>(cell)]; }
  [[nodiscard]] const std::vector<int>& grains() const { return grains_; }
  [[nodiscard]] int cell_of(int grain) const { return cell_of_[static_cast<std::size_t>(grain)]; }

  /// Up to 27 cells around and including `cell`. With fewer than three cells along an axis a cell
  /// may appear in several images; the caller keeps the image that is within its range.
  [[nodiscard]] std::vector<GridNeighbor> Around(int cell) const;

 private:
  std::array<int, 3> count_ = {1, 1, 1};
  std::array<bool, 3> open_ = {false, false, false};
  std::vector<int> cell_of_, begin_, grains_;
};

}  // namespace calib::dem
