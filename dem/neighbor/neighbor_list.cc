#include "dem/neighbor/neighbor_list.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

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

constexpr int kImageBits = 8;  ///< bits of an ImageCode in a Neighbor
constexpr std::uint64_t kImageMask = (std::uint64_t{1} << kImageBits) - 1;

}  // namespace

/// Appends those grains of a run that are listed with `self`: written always, counted where near,
/// since which they are cannot be foreseen.
NeighborSearch::Neighbor* NeighborSearch::AppendNear(const GridGrain& self, double skin,
                                                     const double (&shift)[3], int code,
                                                     std::span<const GridGrain> run,
                                                     Neighbor* end) {
  const double sx = shift[0] - self.x;
  const double sy = shift[1] - self.y;
  const double sz = shift[2] - self.z;
  const double reach = self.radius + skin;
  for (const GridGrain& other : run) {
    const double dx = other.x + sx;
    const double dy = other.y + sy;
    const double dz = other.z + sz;
    const double limit = reach + other.radius;
    *end = static_cast<Neighbor>(other.index) << kImageBits | static_cast<Neighbor>(code);
    end += static_cast<int>(other.index > self.index) &
           static_cast<int>(dx * dx + dy * dy + dz * dz < limit * limit);
  }
  return end;
}

absl::Status NeighborSearch::Build(const PeriodicCell& cell, double skin, ParticleArrays& p,
                                   NeighborList& list) {
  RETURN_IF_ERROR(WrapAll(cell, p));
  const double largest = *std::max_element(p.radius.begin(), p.radius.end());
  const double range = 2 * largest + skin;
  for (int a = 0; a < 3; ++a) {
    if (!cell.open[a] && !(cell.length[a] >= 2 * range)) {
      return absl::OutOfRangeError(absl::StrCat("the cell has become too short along ", kAxis[a],
                                                ": ", cell.length[a], " m, at least ", 2 * range,
                                                " m are needed"));
    }
  }
  grid_.Sort(cell, p, range);
  list.skin = skin;
  list.row.assign(1, 0);
  list.first.clear();
  list.second.clear();
  list.image.clear();
  grains_.clear();
  for (const int g : grid_.grains()) {
    const auto q = static_cast<std::size_t>(g);
    grains_.push_back({.x = p.x[q], .y = p.y[q], .z = p.z[q], .radius = p.radius[q], .index = g});
  }
  found_.resize(std::max(found_.size(), grains_.size() + 1));
  const double tilt = cell.Tilt();
  int grid_cell = -1;
  for (int i = 0; i < p.size(); ++i) {
    if (grid_.cell_of(i) != grid_cell) {
      grid_cell = grid_.cell_of(i);
      grid_.RunsAround(grid_cell, around_);
    }
    const GridGrain self{.x = p.x[i], .y = p.y[i], .z = p.z[i], .radius = p.radius[i], .index = i};
    Neighbor* end = found_.data();
    for (const GridRun& run : around_) {
      if (run.largest > i) {
        const double shift[3] = {run.shift[0] * cell.length[0] + run.shift[2] * tilt,
                                 run.shift[1] * cell.length[1], run.shift[2] * cell.length[2]};
        const int code = ImageCode(run.shift[0], run.shift[1], run.shift[2]);
        // With few cells along an axis a grain may be met in several images.
        const auto room = static_cast<std::size_t>(end - found_.data()) +
                          static_cast<std::size_t>(run.end - run.begin);
        if (room >= found_.size()) {
          const auto size = end - found_.data();
          found_.resize(2 * room);
          end = found_.data() + size;
        }
        end = AppendNear(self, skin, shift, code,
                         {&grains_[static_cast<std::size_t>(run.begin)],
                          static_cast<std::size_t>(run.end - run.begin)},
                         end);
      }
    }
    std::sort(found_.data(), end);
    for (const Neighbor* n = found_.data(); n != end; ++n) {
      const auto j = static_cast<int>(*n >> kImageBits);
      if (!OfOneBody(p, static_cast<std::size_t>(i), static_cast<std::size_t>(j))) {
        list.first.push_back(i);
        list.second.push_back(j);
        list.image.push_back(static_cast<std::uint8_t>(*n & kImageMask));
      }
    }
    list.row.push_back(list.size());
  }
  return absl::OkStatus();
}

}  // namespace calib::dem
