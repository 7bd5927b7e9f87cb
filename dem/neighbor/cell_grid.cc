#include "dem/neighbor/cell_grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace calib::dem {
namespace {

/// Cells along an axis, and cells altogether, for each grain or of a few grains, at most [-].
/// Chosen: what is empty then costs less than the grains do.
constexpr double kCellsAlong = 1024;
constexpr std::size_t kCellsPerGrain = 64;
constexpr std::size_t kCellsOfFew = std::size_t{1} << 20U;

}  // namespace

void CellGrid::Sort(const PeriodicCell& cell, const ParticleArrays& particles, double range) {
  assert(range > 0);
  const double slope = cell.Tilt() / cell.length[2];
  // Two grains within range differ by up to range sqrt(1 + slope^2) in x - slope z.
  const double ranges[3] = {range * std::sqrt(1.0 + slope * slope), range, range};
  for (std::size_t a = 0; a < 3; ++a) {
    count_[a] = static_cast<int>(std::clamp(cell.length[a] / ranges[a], 1.0, kCellsAlong));
    open_[a] = cell.open[a];
  }
  const auto n = static_cast<std::size_t>(particles.size());
  // Small grains far apart: wider cells list the same neighbours.
  while (static_cast<std::size_t>(count_[0]) * count_[1] * count_[2] >
         std::max(kCellsPerGrain * n, kCellsOfFew)) {
    int& most = *std::max_element(count_.begin(), count_.end());
    most = (most + 1) / 2;
  }
  const auto index = [this, &cell](double s, std::size_t a) {
    // Beyond the ends of an open axis the last cells go on for ever; neighbours stay neighbours.
    return static_cast<int>(std::clamp(s / cell.length[a] * count_[a], 0.0, count_[a] - 1.0));
  };
  cell_of_.resize(n);
  begin_.assign(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2] + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const int c = index(particles.x[i] - slope * particles.z[i], 0) +
                  count_[0] * (index(particles.y[i], 1) + count_[1] * index(particles.z[i], 2));
    cell_of_[i] = c;
    ++begin_[static_cast<std::size_t>(c) + 1];
  }
  for (std::size_t c = 1; c < begin_.size(); ++c) {
    begin_[c] += begin_[c - 1];
  }
  grains_.resize(n);
  next_.assign(begin_.begin(), begin_.end() - 1);
  for (std::size_t i = 0; i < n; ++i) {
    const auto c = static_cast<std::size_t>(cell_of_[i]);
    grains_[static_cast<std::size_t>(next_[c]++)] = static_cast<int>(i);
  }
}

void CellGrid::RunsAround(int cell, std::vector<GridRun>& runs) const {
  const int cx = cell % count_[0];
  const int cy = cell / count_[0] % count_[1];
  const int cz = cell / count_[0] / count_[1];
  runs.clear();
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      int last = -1;  // where the run at hand ends
      for (int dx = -1; dx <= 1; ++dx) {
        const int raw[3] = {cx + dx, cy + dy, cz + dz};
        GridRun run;
        int wrapped[3];
        bool outside = false;
        for (int a = 0; a < 3; ++a) {
          const int count = count_[static_cast<std::size_t>(a)];
          run.shift[a] = raw[a] < 0 ? -1 : (raw[a] >= count ? 1 : 0);
          outside = outside || (run.shift[a] != 0 && open_[static_cast<std::size_t>(a)]);
          wrapped[a] = raw[a] - run.shift[a] * count;
        }
        const int c = wrapped[0] + count_[0] * (wrapped[1] + count_[1] * wrapped[2]);
        run.begin = begin(c);
        run.end = begin(c + 1);
        if (outside || run.begin == run.end) {
          continue;
        }
        run.largest = grains_[static_cast<std::size_t>(run.end) - 1];
        if (last == run.begin && runs.back().shift[0] == run.shift[0]) {
          runs.back().end = run.end;
          runs.back().largest = std::max(runs.back().largest, run.largest);
        } else {
          runs.push_back(run);
        }
        last = run.end;
      }
    }
  }
}

}  // namespace calib::dem
