#pragma once
// Grains sorted into a regular grid over the periodic cell.

#include <array>
#include <vector>

#include "dem/geometry/periodic_cell.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {

/// Grains [begin, end) of grains() that lie in neighbouring grid cells beside each other along x,
/// and the shift of the periodic image they are seen in.
struct GridRun {
  int begin = 0, end = 0;
  int shift[3] = {0, 0, 0};
  int largest = -1;  ///< index of a grain among them; -1: there is none
};

/// Which grains lie in which cell of the grid. Reading is thread-safe, Sort() is not.
class CellGrid {
 public:
  CellGrid() = default;
  CellGrid(const PeriodicCell& cell, const ParticleArrays& particles, double range) {
    Sort(cell, particles, range);
  }

  /// Sorts wrapped centres (0 <= z < Lz, 0 <= x - z tilt/Lz < Lx; anywhere along open axes) into
  /// grid cells of at least `range` [m] > 0 per edge, wider ones where the grains are few; in a
  /// sheared cell the edges along x follow its tilt and are longer. Memory of an earlier sorting is
  /// used again.
  void Sort(const PeriodicCell& cell, const ParticleArrays& particles, double range);

  /// Where the grains of a grid cell begin: those of cell c are grains()[begin(c)] ..
  /// grains()[begin(c + 1) - 1], in ascending order.
  [[nodiscard]] int begin(int cell) const { return begin_[static_cast<std::size_t>(cell)]; }
  /// Indices of all grains, cell after cell.
  [[nodiscard]] const std::vector<int>& grains() const { return grains_; }
  /// Grid cell of a grain.
  [[nodiscard]] int cell_of(int grain) const { return cell_of_[static_cast<std::size_t>(grain)]; }

  /// The grains of up to 27 cells around and including `cell`, as runs. With fewer than three cells
  /// along an axis a cell may appear in several images; the caller keeps the image that is within
  /// its range.
  void RunsAround(int cell, std::vector<GridRun>& runs) const;

 private:
  std::array<int, 3> count_ = {1, 1, 1};
  std::array<bool, 3> open_ = {false, false, false};
  std::vector<int> cell_of_, begin_, grains_, next_;
};

}  // namespace calib::dem
