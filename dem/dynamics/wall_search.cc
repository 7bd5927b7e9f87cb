// Which walls a grain may touch until the next search.
#include <algorithm>
#include <cmath>
#include <utility>

#include "dem/dynamics/wall_contacts.h"

namespace calib::dem {
namespace {

struct Box {
  Vec3 low, high;

  [[nodiscard]] bool Within(const Vec3& p, double range) const {
    return p.x > low.x - range && p.x < high.x + range && p.y > low.y - range &&
           p.y < high.y + range && p.z > low.z - range && p.z < high.z + range;
  }
  void Include(const Vec3& v) {
    low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
    high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
  }
};

/// Boxes about the triangles of a wall, and about all of them.
struct WallBoxes {
  Box all;
  std::vector<Box> triangle;
};

WallBoxes BoxesOf(const TriangleMesh& mesh) {
  WallBoxes boxes;
  for (const auto& corner : mesh.triangle) {
    const Vec3& first = mesh.vertex[static_cast<std::size_t>(corner[0])];
    Box box{.low = first, .high = first};
    box.Include(mesh.vertex[static_cast<std::size_t>(corner[1])]);
    box.Include(mesh.vertex[static_cast<std::size_t>(corner[2])]);
    if (boxes.triangle.empty()) {
      boxes.all = box;
    }
    boxes.all.Include(box.low);
    boxes.all.Include(box.high);
    boxes.triangle.push_back(box);
  }
  return boxes;
}

}  // namespace

Vec3 WallContacts::NearestOn(const Candidate& candidate, const Vec3& p) const {
  const Wall& wall = walls_[static_cast<std::size_t>(candidate.wall)];
  if (candidate.triangle < 0) {
    return p - Dot(p - wall.point, wall.normal) * wall.normal;
  }
  const auto& corner = wall.mesh.triangle[static_cast<std::size_t>(candidate.triangle)];
  return NearestPoint(p, wall.mesh.vertex[static_cast<std::size_t>(corner[0])],
                      wall.mesh.vertex[static_cast<std::size_t>(corner[1])],
                      wall.mesh.vertex[static_cast<std::size_t>(corner[2])]);
}

void WallContacts::Search(const ParticleArrays& p, double skin) {
  std::vector<WallBoxes> boxes;
  searched_.clear();
  for (const Wall& wall : walls_) {
    boxes.push_back(BoxesOf(wall.mesh));
    searched_.push_back(wall.IsPlane() ? std::vector<Vec3>{wall.point} : wall.mesh.vertex);
  }
  moved_ = 0;
  std::vector<Row> old = std::exchange(rows_, {});
  candidates_.clear();
  std::size_t o = 0;
  for (int g = 0; g < p.size(); ++g) {
    const auto q = static_cast<std::size_t>(g);
    const Vec3 centre{p.x[q], p.y[q], p.z[q]};
    const double range = p.radius[q] + skin;
    const std::size_t first = candidates_.size();
    for (std::size_t w = 0; w < walls_.size(); ++w) {
      const Wall& wall = walls_[w];
      if (!wall.active) {
        continue;
      }
      if (wall.IsPlane()) {
        if (Dot(centre - wall.point, wall.normal) < range) {
          candidates_.push_back({.wall = static_cast<int>(w)});
        }
        continue;
      }
      if (!boxes[w].all.Within(centre, range)) {
        continue;
      }
      for (std::size_t t = 0; t < boxes[w].triangle.size(); ++t) {
        const Candidate candidate{.wall = static_cast<int>(w), .triangle = static_cast<int>(t)};
        if (boxes[w].triangle[t].Within(centre, range)) {
          const Vec3 d = NearestOn(candidate, centre) - centre;
          if (Dot(d, d) < range * range) {
            candidates_.push_back(candidate);
          }
        }
      }
    }
    while (o < old.size() && old[o].grain < g) {
      ++o;
    }
    if (candidates_.size() > first) {
      Row row = o < old.size() && old[o].grain == g ? old[o] : Row{};
      row.grain = g;
      row.first_candidate = static_cast<int>(first);
      rows_.push_back(row);
    }
  }
}

void WallContacts::Move(double dt) {
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    Wall& wall = walls_[w];
    if (!wall.Moves()) {
      continue;
    }
    wall.Move(dt);
    if (searched_.size() != walls_.size()) {
      continue;
    }
    double largest2 = 0;
    for (std::size_t v = 0; v < searched_[w].size(); ++v) {
      const Vec3 u = (wall.IsPlane() ? wall.point : wall.mesh.vertex[v]) - searched_[w][v];
      largest2 = std::max(largest2, Dot(u, u));
    }
    moved_ = std::max(moved_, std::sqrt(largest2));
  }
}

void WallContacts::Renumber(const std::vector<int>& to) {
  std::vector<Row> kept;
  for (Row& row : rows_) {
    row.grain = to[static_cast<std::size_t>(row.grain)];
    if (row.grain >= 0) {
      kept.push_back(row);
    }
  }
  rows_ = std::move(kept);
}

}  // namespace calib::dem
