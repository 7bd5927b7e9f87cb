// Which walls a grain may touch until the next search.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "dem/dynamics/wall_contacts.h"
#include "dem/geometry/triangle_grid.h"

namespace calib::dem {

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
  std::vector<TriangleGrid> grids;
  std::vector<int> near;
  searched_.clear();
  for (const Wall& wall : walls_) {
    grids.emplace_back(wall.mesh, widest + skin);
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
      grids[w].Near(centre, range, near);
      for (const int t : near) {
        Candidate candidate{.wall = static_cast<int>(w), .triangle = t};
        candidate.distance = Length(NearestOn(candidate, centre) - centre);
        if (candidate.distance < range) {
          candidates_.push_back(candidate);
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
        const Contact& contact =
            old_slots_[static_cast<std::size_t>(old->first) + static_cast<std::size_t>(c)];
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
