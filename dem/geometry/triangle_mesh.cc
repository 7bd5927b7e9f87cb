#include "dem/geometry/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"

namespace calib::dem {

Vec3 NearestPoint(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = p - a;
  const double d1 = Dot(ab, ap);
  const double d2 = Dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) {
    return a;
  }
  const Vec3 bp = p - b;
  const double d3 = Dot(ab, bp);
  const double d4 = Dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) {
    return b;
  }
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    return a + (d1 / (d1 - d3)) * ab;
  }
  const Vec3 cp = p - c;
  const double d5 = Dot(ab, cp);
  const double d6 = Dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) {
    return c;
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    return a + (d2 / (d2 - d6)) * ac;
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    return b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b);
  }
  const double scale = 1.0 / (va + vb + vc);
  return a + (vb * scale) * ab + (vc * scale) * ac;
}

Bounds BoundsOf(const TriangleMesh& mesh) {
  Bounds bounds{.low = mesh.vertex.front(), .high = mesh.vertex.front()};
  for (const Vec3& v : mesh.vertex) {
    bounds.low = {std::min(bounds.low.x, v.x), std::min(bounds.low.y, v.y),
                  std::min(bounds.low.z, v.z)};
    bounds.high = {std::max(bounds.high.x, v.x), std::max(bounds.high.y, v.y),
                   std::max(bounds.high.z, v.z)};
  }
  return bounds;
}

TriangleMesh Shifted(TriangleMesh mesh, const Vec3& by) {
  for (Vec3& v : mesh.vertex) {
    v = v + by;
  }
  return mesh;
}

namespace {

int AddVertex(const Vec3& v, TriangleMesh& mesh) {
  mesh.vertex.push_back(v);
  return static_cast<int>(mesh.vertex.size()) - 1;
}

bool Same(const Vec3& a, const Vec3& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

/// Point `along` the axis at radius r and angle of side k.
Vec3 OnCircle(const Vec3& centre, double along, double r, int k, int sides, bool along_y) {
  const double angle = 2.0 * std::numbers::pi * (k % sides) / sides;
  const double u = r * Cosine(angle);
  const double v = r * Sine(angle);
  return along_y ? Vec3{centre.x + u, centre.y + along, centre.z + v}
                 : Vec3{centre.x + u, centre.y + v, centre.z + along};
}

void AddSides(const Frustum& f, bool along_y, TriangleMesh& mesh) {
  for (int k = 0; k < f.sides; ++k) {
    AddQuad(OnCircle(f.centre, 0, f.lower_radius, k, f.sides, along_y),
            OnCircle(f.centre, 0, f.lower_radius, k + 1, f.sides, along_y),
            OnCircle(f.centre, f.height, f.upper_radius, k + 1, f.sides, along_y),
            OnCircle(f.centre, f.height, f.upper_radius, k, f.sides, along_y), mesh);
  }
}

double SizeOf(const TriangleMesh& mesh) {
  Vec3 low = mesh.vertex.front();
  Vec3 high = low;
  for (const Vec3& v : mesh.vertex) {
    low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
    high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
  }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

}  // namespace

std::vector<int> PlacesOf(const TriangleMesh& mesh) {
  const double tolerance = 1e-9 * SizeOf(mesh);
  std::map<std::tuple<std::int64_t, std::int64_t, std::int64_t>, int> known;
  std::vector<int> places;
  for (const Vec3& v : mesh.vertex) {
    const auto on_grid = [&](double s) {
      return static_cast<std::int64_t>(std::llround(s / tolerance));
    };
    const std::tuple key(on_grid(v.x), on_grid(v.y), on_grid(v.z));
    places.push_back(known.emplace(key, static_cast<int>(known.size())).first->second);
  }
  return places;
}

void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, TriangleMesh& mesh) {
  const int ia = AddVertex(a, mesh);
  const int ib = AddVertex(b, mesh);
  const int ic = AddVertex(c, mesh);
  const int id = AddVertex(d, mesh);
  if (!Same(a, b) && !Same(b, c)) {
    mesh.triangle.push_back({ia, ib, ic});
  }
  if (!Same(c, d) && !Same(d, a)) {
    mesh.triangle.push_back({ia, ic, id});
  }
}

void AddFrustum(const Frustum& frustum, TriangleMesh& mesh) { AddSides(frustum, false, mesh); }

void AddFrustumAlongY(const Frustum& frustum, TriangleMesh& mesh) { AddSides(frustum, true, mesh); }

std::vector<std::string> MeshProblems(const TriangleMesh& mesh, bool closed) {
  constexpr std::size_t kMost = 10;  // problems that are told [-], chosen: a screenful
  if (mesh.triangle.empty()) {
    return {"the mesh has no triangles"};
  }
  for (const Vec3& v : mesh.vertex) {
    if (!std::isfinite(v.x + v.y + v.z)) {
      return {"a coordinate of the mesh is not a finite number"};
    }
  }
  const double size = SizeOf(mesh);
  if (!(size > 0)) {
    return {"all vertices of the mesh lie at one place"};
  }
  std::vector<std::string> problems;
  const auto report = [&](std::string problem) {
    if (problems.size() < kMost) {
      problems.push_back(std::move(problem));
    }
  };
  const std::vector<int> place = PlacesOf(mesh);
  std::map<std::pair<int, int>, std::pair<int, int>> edges;  // places -> triangles, first of them
  for (int t = 0; t < mesh.size(); ++t) {
    const auto& corner = mesh.triangle[static_cast<std::size_t>(t)];
    const auto at = [&](std::size_t k) -> const Vec3& {
      return mesh.vertex[static_cast<std::size_t>(corner[k])];
    };
    const double area = 0.5 * Length(Cross(at(1) - at(0), at(2) - at(0)));
    const double longest =
        std::max({Length(at(1) - at(0)), Length(at(2) - at(1)), Length(at(0) - at(2))});
    if (!(area > 1e-9 * longest * longest)) {
      report(absl::StrCat("triangle ", t + 1, " is degenerate: its area is ", area,
                          " m^2, its longest edge ", longest, " m"));
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = place[static_cast<std::size_t>(corner[k])];
      const int b = place[static_cast<std::size_t>(corner[(k + 1) % 3])];
      auto& edge = edges[std::minmax(a, b)];
      if (edge.first++ == 0) {
        edge.second = t;
      }
    }
  }
  for (const auto& [ends, edge] : edges) {
    if (edge.first > 2) {
      report(absl::StrCat("an edge of triangle ", edge.second + 1, " belongs to ", edge.first,
                          " triangles, a surface has at most two at an edge"));
    } else if (closed && edge.first == 1) {
      report(absl::StrCat("the mesh has a hole: an edge of triangle ", edge.second + 1,
                          " has no second triangle"));
    }
  }
  return problems;
}

}  // namespace calib::dem
