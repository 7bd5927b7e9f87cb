#pragma once
// Which places within a vessel of triangles have room for a sphere.

#include <vector>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// A vessel open at the top, the bottom or both. A place lies within where lines from it along +x,
/// -x, +y and -y all meet the mesh. Immutable; thread-safe. Cost: one look at each triangle's box
/// per question.
class MeshInterior {
 public:
  /// The mesh must outlive it. Precondition: MeshProblems() finds nothing.
  explicit MeshInterior(const TriangleMesh& mesh);

  /// Whether a sphere [m] lies within and touches no triangle.
  [[nodiscard]] bool Holds(const Vec3& centre, double radius) const;

 private:
  const TriangleMesh& mesh_;
  std::vector<Bounds> boxes_;
};

}  // namespace calib::dem
