#include "dem/neighbor/neighbor_list.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/neighbor/cell_grid.h"

namespace calib::dem {
namespace {

constexpr const char* kAxis[3] = {"x", "y", "z"};

/// Moves s into [0, length). Multiples beyond one cell cannot occur between two searches but cost
/// nothing to allow.
double Wrap(double s, double length) {
  const double wrapped = s - std::floor(s / length) * length;
  return wrapped < length ? wrapped : 0.0;
}

absl::Status WrapAll(const PeriodicCell& cell, ParticleArrays& p) {
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    if (!std::isfinite(p.x[i]) || !std::isfinite(p.y[i]) || !std::isfinite(p.z[i])) {
      return absl::OutOfRangeError(
          absl::StrCat("grain ", p.id[i], " has no finite position (NaN or lost)"));
    }
    p.y[i] = cell.open[1] ? p.y[i] : Wrap(p.y[i], cell.length[1]);
    const double z = cell.open[2] ? p.z[i] : Wrap(p.z[i], cell.length[2]);
    if (cell.Tilt() != 0) {  // sheared cells have no open axes
      const double across = std::round((z - p.z[i]) / cell.length[2]);
      const double skew = z / cell.length[2] * cell.Tilt();
      p.x[i] = Wrap(p.x[i] + across * cell.Tilt() - skew, cell.length[0]) + skew;
    } else {
      p.x[i] = cell.open[0] ? p.x[i] : Wrap(p.x[i], cell.length[0]);
    }
    p.z[i] = z;
  }
  return absl::OkStatus();
}

bool OfOneBody(const ParticleArrays& p, std::size_t i, std::size_t j) {
  return !p.body.empty() && p.body[i] >= 0 && p.body[i] == p.body[j];
}

/// Slots come sorted by (i, j), so that one pass in slot order meets, for a grain q, first the
/// pairs (i, q) with i < q, then (q, j): its row of places fills in ascending order of neighbours.
void AssignPlaces(int grains, NeighborList& list) {
  list.place_row.assign(static_cast<std::size_t>(grains) + 1, 0);
  for (std::size_t s = 0; s < list.second.size(); ++s) {
    ++list.place_row[static_cast<std::size_t>(list.first[s]) + 1];
    ++list.place_row[static_cast<std::size_t>(list.second[s]) + 1];
  }
  for (std::size_t i = 1; i < list.place_row.size(); ++i) {
    list.place_row[i] += list.place_row[i - 1];
  }
  std::vector<int> next(list.place_row.begin(), list.place_row.end() - 1);
  list.place_i.resize(list.second.size());
  list.place_j.resize(list.second.size());
  for (std::size_t s = 0; s < list.second.size(); ++s) {
    list.place_i[s] = next[static_cast<std::size_t>(list.first[s])]++;
    list.place_j[s] = next[static_cast<std::size_t>(list.second[s])]++;
  }
}

}  // namespace

absl::Status BuildNeighborList(const PeriodicCell& cell, double skin, ParticleArrays& p,
                               NeighborList& list) {
  if (auto s = WrapAll(cell, p); !s.ok()) {
    return s;
  }
  const double largest = *std::max_element(p.radius.begin(), p.radius.end());
  const double range = 2 * largest + skin;
  for (int a = 0; a < 3; ++a) {
    if (!cell.open[a] && !(cell.length[a] >= 2 * range)) {
      return absl::OutOfRangeError(absl::StrCat("the cell has become too short along ", kAxis[a],
                                                ": ", cell.length[a], " m, at least ", 2 * range,
                                                " m are needed"));
    }
  }
  const CellGrid grid(cell, p, range);
  list.skin = skin;
  list.row.assign(1, 0);
  list.first.clear();
  list.second.clear();
  list.image.clear();
  std::vector<std::pair<int, std::uint8_t>> found;  // neighbour j > i, image
  const double tilt = cell.Tilt();
  int grid_cell = -1;
  std::vector<GridNeighbor> around;
  for (int i = 0; i < p.size(); ++i) {
    if (grid.cell_of(i) != grid_cell) {
      grid_cell = grid.cell_of(i);
      around = grid.Around(grid_cell);
    }
    found.clear();
    for (const GridNeighbor& neighbor : around) {
      const double sx = neighbor.shift[0] * cell.length[0] + neighbor.shift[2] * tilt - p.x[i];
      const double sy = neighbor.shift[1] * cell.length[1] - p.y[i];
      const double sz = neighbor.shift[2] * cell.length[2] - p.z[i];
      const double reach = p.radius[i] + skin;
      const int end = grid.begin(neighbor.cell + 1);
      for (int g = grid.begin(neighbor.cell); g < end; ++g) {
        const int j = grid.grains()[static_cast<std::size_t>(g)];
        const double dx = p.x[j] + sx;
        const double dy = p.y[j] + sy;
        const double dz = p.z[j] + sz;
        const double limit = reach + p.radius[j];
        if (j > i && dx * dx + dy * dy + dz * dz < limit * limit &&
            !OfOneBody(p, static_cast<std::size_t>(i), static_cast<std::size_t>(j))) {
          found.emplace_back(j, static_cast<std::uint8_t>(ImageCode(
                                    neighbor.shift[0], neighbor.shift[1], neighbor.shift[2])));
        }
      }
    }
    std::sort(found.begin(), found.end());
    for (const auto& [j, image] : found) {
      list.first.push_back(i);
      list.second.push_back(j);
      list.image.push_back(image);
    }
    list.row.push_back(list.size());
  }
  AssignPlaces(p.size(), list);
  return absl::OkStatus();
}

}  // namespace calib::dem
