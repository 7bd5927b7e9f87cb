#include "dem/geometry/mesh_interior.h"

#include <array>

namespace calib::dem {
namespace {

/// A triangle's corner seen along a line: across it (s, t) from the line, `along` it.
struct Corner {
  double s, t, along;
};

/// Where the line s = t = 0 meets a triangle: -1 behind, 1 ahead, 0 nowhere. Edges belong to the
/// triangle, so that a line through one of a mesh meets it.
int Side(const Corner& a, const Corner& b, const Corner& c) {
  const double ab = a.s * b.t - a.t * b.s;
  const double bc = b.s * c.t - b.t * c.s;
  const double ca = c.s * a.t - c.t * a.s;
  const double area = ab + bc + ca;
  const bool inside = (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
  if (!inside || area == 0) {
    return 0;
  }
  return (bc * a.along + ca * b.along + ab * c.along) / area < 0 ? -1 : 1;
}

}  // namespace

MeshInterior::MeshInterior(const TriangleMesh& mesh) : mesh_(mesh) {
  for (const auto& corner : mesh.triangle) {
    TriangleMesh one;
    for (const int k : corner) {
      one.vertex.push_back(mesh.vertex[static_cast<std::size_t>(k)]);
    }
    boxes_.push_back(BoundsOf(one));
  }
}

bool MeshInterior::Holds(const Vec3& centre, double radius) const {
  bool behind_x = false;
  bool ahead_x = false;
  bool behind_y = false;
  bool ahead_y = false;
  for (std::size_t t = 0; t < boxes_.size(); ++t) {
    const Bounds& box = boxes_[t];
    if (box.low.z > centre.z + radius || box.high.z < centre.z - radius) {
      continue;
    }
    std::array<Vec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = mesh_.vertex[static_cast<std::size_t>(mesh_.triangle[t][k])] - centre;
    }
    const Vec3 nearest = NearestPoint({}, p[0], p[1], p[2]);
    if (Dot(nearest, nearest) <= radius * radius) {
      return false;
    }
    const auto along = [&](bool x) {
      std::array<Corner, 3> corner;
      for (std::size_t k = 0; k < 3; ++k) {
        corner[k] = x ? Corner{.s = p[k].y, .t = p[k].z, .along = p[k].x}
                      : Corner{.s = p[k].x, .t = p[k].z, .along = p[k].y};
      }
      return Side(corner[0], corner[1], corner[2]);
    };
    const int x = along(true);
    const int y = along(false);
    behind_x = behind_x || x < 0;
    ahead_x = ahead_x || x > 0;
    behind_y = behind_y || y < 0;
    ahead_y = ahead_y || y > 0;
  }
  return behind_x && ahead_x && behind_y && ahead_y;
}

}  // namespace calib::dem
