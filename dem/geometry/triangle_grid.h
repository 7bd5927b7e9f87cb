#pragma once
// Which triangles of a mesh may be near a point, without asking all of them.

#include <array>
#include <vector>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// A regular grid over a mesh as it lies when the grid is made; a mesh that moves needs a new one.
/// Immutable; thread-safe. It keeps no reference to the mesh.
class TriangleGrid {
 public:
  /// range [m] > 0: the largest distance that will be asked for. A mesh without triangles has
  /// nothing near.
  TriangleGrid(const TriangleMesh& mesh, double range);

  /// Replaces `near` by the triangles whose bounding boxes come within `distance` of p, ascending.
  /// Precondition: distance <= range.
  void Near(const Vec3& p, double distance, std::vector<int>& near) const;

 private:
  /// Cells per axis [-]. Chosen: a grid must not cost more than it saves.
  static constexpr int kMostCells = 16;

  [[nodiscard]] std::array<int, 3> CellOf(const Vec3& p) const;
  [[nodiscard]] std::size_t Index(const std::array<int, 3>& cell) const;

  std::vector<Bounds> boxes_;  ///< of the triangles
  Bounds all_{};
  Vec3 low_{};  ///< corner of the grid: that of all_, widened by the range
  std::array<int, 3> count_ = {1, 1, 1};
  std::array<double, 3> per_length_ = {0, 0, 0};  ///< cells per metre
  std::vector<int> first_, triangles_;  ///< CSR: triangles whose widened boxes reach into a cell
};

}  // namespace calib::dem
