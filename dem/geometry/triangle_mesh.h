#pragma once
// Surfaces made of flat triangles: what walls are made of.

#include <array>
#include <string>
#include <vector>

#include "dem/geometry/vector3.h"

namespace calib::dem {

/// Vertices and the triangles between them.
struct TriangleMesh {
  std::vector<Vec3> vertex;                  ///< [m]
  std::vector<std::array<int, 3>> triangle;  ///< indices of vertices

  [[nodiscard]] int size() const { return static_cast<int>(triangle.size()); }
};

/// Nearest point of the triangle a b c to p. Pure; the triangle has an area.
/// [Ericson 2005, Real-Time Collision Detection, sec. 5.1.5: regions of the Voronoi diagram]
Vec3 NearestPoint(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// Corners of a box along the axes [m].
struct Bounds {
  Vec3 low, high;
};
/// The smallest box that holds all vertices. Precondition: there is a vertex.
Bounds BoundsOf(const TriangleMesh& mesh);

/// The mesh moved by a vector [m].
TriangleMesh Shifted(TriangleMesh mesh, const Vec3& by);

/// Adds the two triangles a b c and a c d to the mesh. Preconditions: the corners lie in a plane,
/// in order around it.
void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, TriangleMesh& mesh);

/// The side of a cylinder or cone about a vertical axis: `sides` flat faces whose edges lie on the
/// two circles. Radii [m] >= 0, not both zero; a cone's tip gives triangles.
struct Frustum {
  Vec3 centre{};            ///< of the lower circle [m]
  double height = 0;        ///< [m]; 0: a flat ring
  double lower_radius = 0;  ///< [m]
  double upper_radius = 0;  ///< [m]
  int sides = 24;           ///< >= 3
};
/// Adds the side of the frustum to the mesh.
void AddFrustum(const Frustum& frustum, TriangleMesh& mesh);

/// Adds the side of a frustum about a horizontal axis along y to the mesh: `centre` is the middle
/// of the circle at the smaller y, which has lower_radius; height is the length along y.
void AddFrustumAlongY(const Frustum& frustum, TriangleMesh& mesh);

/// For each vertex the number of its place: vertices that agree within 1e-9 of the mesh's size
/// share it.
std::vector<int> PlacesOf(const TriangleMesh& mesh);

/// What is wrong with a surface, one sentence each, at most ten; empty: nothing. Vertices count as
/// the same where they agree within 1e-9 of the mesh's size. Wrong are: no triangle, a coordinate
/// that is not finite, a triangle without area, an edge of more than two triangles and, where
/// `closed`, an edge of one triangle only (a hole).
std::vector<std::string> MeshProblems(const TriangleMesh& mesh, bool closed);

}  // namespace calib::dem
