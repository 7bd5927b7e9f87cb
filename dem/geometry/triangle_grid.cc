#include "dem/geometry/triangle_grid.h"

#include <algorithm>
#include <utility>

namespace calib::dem {
namespace {

Bounds Widened(const Bounds& box, double by) {
  const Vec3 d{by, by, by};
  return {.low = box.low - d, .high = box.high + d};
}

bool Within(const Bounds& box, const Vec3& p) {
  return p.x > box.low.x && p.x < box.high.x && p.y > box.low.y && p.y < box.high.y &&
         p.z > box.low.z && p.z < box.high.z;
}

Bounds BoundsOfTriangle(const TriangleMesh& mesh, const std::array<int, 3>& corners) {
  const auto at = [&](std::size_t c) { return mesh.vertex[static_cast<std::size_t>(corners[c])]; };
  const Vec3 a = at(0);
  const Vec3 b = at(1);
  const Vec3 c = at(2);
  return {
      .low = {std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y}), std::min({a.z, b.z, c.z})},
      .high = {std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y}), std::max({a.z, b.z, c.z})}};
}

}  // namespace

TriangleGrid::TriangleGrid(const TriangleMesh& mesh, double range) {
  if (mesh.triangle.empty()) {
    return;
  }
  for (const auto& corners : mesh.triangle) {
    boxes_.push_back(BoundsOfTriangle(mesh, corners));
  }
  all_ = BoundsOf(mesh);
  const Bounds reach = Widened(all_, range);
  low_ = reach.low;
  const Vec3 size = reach.high - reach.low;
  const double extent[3] = {size.x, size.y, size.z};
  for (std::size_t a = 0; a < 3; ++a) {
    count_[a] = std::clamp(static_cast<int>(extent[a] / (4 * range)), 1, kMostCells);
    per_length_[a] = count_[a] / extent[a];
  }
  first_.assign(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2] + 1, 0);
  const auto visit_all = [&](const auto& visit) {
    for (std::size_t t = 0; t < boxes_.size(); ++t) {
      const Bounds box = Widened(boxes_[t], range);
      const auto low = CellOf(box.low);
      const auto high = CellOf(box.high);
      for (int z = low[2]; z <= high[2]; ++z) {
        for (int y = low[1]; y <= high[1]; ++y) {
          for (int x = low[0]; x <= high[0]; ++x) {
            visit(Index({x, y, z}), static_cast<int>(t));
          }
        }
      }
    }
  };
  visit_all([this](std::size_t cell, int) { ++first_[cell + 1]; });
  for (std::size_t c = 1; c < first_.size(); ++c) {
    first_[c] += first_[c - 1];
  }
  triangles_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<int> next(first_.begin(), first_.end() - 1);
  visit_all(
      [&](std::size_t cell, int t) { triangles_[static_cast<std::size_t>(next[cell]++)] = t; });
}

std::array<int, 3> TriangleGrid::CellOf(const Vec3& p) const {
  const double at[3] = {p.x - low_.x, p.y - low_.y, p.z - low_.z};
  std::array<int, 3> cell{};
  for (std::size_t a = 0; a < 3; ++a) {
    cell[a] = static_cast<int>(std::clamp(at[a] * per_length_[a], 0.0, count_[a] - 1.0));
  }
  return cell;
}

std::size_t TriangleGrid::Index(const std::array<int, 3>& cell) const {
  return static_cast<std::size_t>(cell[0]) +
         static_cast<std::size_t>(count_[0]) *
             (static_cast<std::size_t>(cell[1]) +
              static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(cell[2]));
}

void TriangleGrid::Near(const Vec3& p, double distance, std::vector<int>& near) const {
  near.clear();
  if (boxes_.empty() || !Within(Widened(all_, distance), p)) {
    return;
  }
  const std::size_t cell = Index(CellOf(p));
  for (int k = first_[cell]; k < first_[cell + 1]; ++k) {
    const int t = triangles_[static_cast<std::size_t>(k)];
    if (Within(Widened(boxes_[static_cast<std::size_t>(t)], distance), p)) {
      near.push_back(t);
    }
  }
}

}  // namespace calib::dem
