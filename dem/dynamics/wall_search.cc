// Which walls a grain may touch until the next search.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

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
  Box all{};
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

/// Triangles by the cells of a regular grid that their boxes, widened by a range, reach into.
class TriangleGrid {
 public:
  TriangleGrid(const WallBoxes& boxes, double range)
      : low_(boxes.all.low - Vec3{range, range, range}) {
    const Vec3 size = boxes.all.high + Vec3{range, range, range} - low_;
    const double extent[3] = {size.x, size.y, size.z};
    for (std::size_t a = 0; a < 3; ++a) {
      count_[a] = std::clamp(static_cast<int>(extent[a] / (4 * range)), 1, kMostCells);
      per_length_[a] = count_[a] / extent[a];
    }
    first_.assign(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2] + 1, 0);
    const auto visit_all = [&](const auto& visit) {
      for (std::size_t t = 0; t < boxes.triangle.size(); ++t) {
        const Box& box = boxes.triangle[t];
        const auto low = CellOf(box.low - Vec3{range, range, range});
        const auto high = CellOf(box.high + Vec3{range, range, range});
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

  /// Triangles that may be within the range of a point, ascending. Precondition: the point is
  /// within the range of the box about all.
  [[nodiscard]] std::span<const int> Near(const Vec3& p) const {
    const std::size_t cell = Index(CellOf(p));
    const auto begin = static_cast<std::size_t>(first_[cell]);
    return {&triangles_[begin], static_cast<std::size_t>(first_[cell + 1]) - begin};
  }

 private:
  static constexpr int kMostCells = 16;  // per axis: a search must not cost more than it saves

  [[nodiscard]] std::array<int, 3> CellOf(const Vec3& p) const {
    const double at[3] = {p.x - low_.x, p.y - low_.y, p.z - low_.z};
    std::array<int, 3> cell{};
    for (std::size_t a = 0; a < 3; ++a) {
      cell[a] = static_cast<int>(std::clamp(at[a] * per_length_[a], 0.0, count_[a] - 1.0));
    }
    return cell;
  }
  [[nodiscard]] std::size_t Index(const std::array<int, 3>& c) const {
    return static_cast<std::size_t>(c[0] + count_[0] * (c[1] + count_[1] * c[2]));
  }

  Vec3 low_;
  std::array<int, 3> count_ = {1, 1, 1};
  std::array<double, 3> per_length_ = {0, 0, 0};
  std::vector<int> first_, triangles_;  ///< CSR over cells
};

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
  const double widest = p.radius.empty() ? 0 : *std::max_element(p.radius.begin(), p.radius.end());
  std::vector<WallBoxes> boxes;
  std::vector<std::optional<TriangleGrid>> grids;
  searched_.clear();
  for (const Wall& wall : walls_) {
    boxes.push_back(BoxesOf(wall.mesh));
    grids.emplace_back();
    if (!wall.IsPlane()) {
      grids.back().emplace(boxes.back(), widest + skin);
    }
    searched_.push_back(wall.IsPlane() ? std::vector<Vec3>{wall.point} : wall.mesh.vertex);
  }
  moved_ = 0;
  std::swap(rows_, old_rows_);
  std::swap(slots_, old_slots_);
  rows_.clear();
  slots_.clear();
  candidates_.clear();
  auto old = old_rows_.begin();
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
        const double distance = Dot(centre - wall.point, wall.normal);
        if (distance < range) {
          candidates_.push_back({.wall = static_cast<int>(w), .distance = std::abs(distance)});
        }
        continue;
      }
      if (!boxes[w].all.Within(centre, range)) {
        continue;
      }
      for (const int t : grids[w]->Near(centre)) {
        if (boxes[w].triangle[static_cast<std::size_t>(t)].Within(centre, range)) {
          Candidate candidate{.wall = static_cast<int>(w), .triangle = t};
          candidate.distance = Length(NearestOn(candidate, centre) - centre);
          if (candidate.distance < range) {
            candidates_.push_back(candidate);
          }
        }
      }
    }
    while (old != old_rows_.end() && old->grain < g) {
      ++old;
    }
    if (candidates_.size() == first) {
      continue;
    }
    Row row{.grain = g, .first = static_cast<int>(first)};
    slots_.resize(candidates_.size());
    if (old != old_rows_.end() && old->grain == g) {
      row.load = old->load;
      for (int c = 0; c < old->contacts; ++c) {
        const Contact& contact = old_slots_[static_cast<std::size_t>(old->first + c)];
        const bool room = first + static_cast<std::size_t>(row.contacts) < slots_.size();
        if (room && walls_[static_cast<std::size_t>(contact.wall)].active) {
          ContactOf(row, row.contacts++) = contact;
        }
      }
    }
    rows_.push_back(row);
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
  for (Row& row : rows_) {
    row.grain = to[static_cast<std::size_t>(row.grain)];
  }
  std::erase_if(rows_, [](const Row& row) { return row.grain < 0; });
}

}  // namespace calib::dem
