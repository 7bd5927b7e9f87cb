#include "dem/neighbor/packing_overlap.h"

#include <algorithm>
#include <cmath>

#include "dem/neighbor/neighbor_list.h"

namespace calib::dem {
namespace {

/// Overlap in smaller radii from which no run can start [-]. Chosen: that of
/// Assembly::EstimateStiffness().
constexpr double kDeepest = 0.5;

}  // namespace

std::optional<PackingOverlap> DeepOverlap(const Packing& packing) {
  ParticleArrays p = MakeParticles(packing, 1.0);
  p.body.clear();
  for (const int grain : p.id) {
    p.body.push_back(packing.clump[static_cast<std::size_t>(grain)]);
  }
  PeriodicCell cell;
  std::copy(std::begin(packing.length), std::end(packing.length), std::begin(cell.length));
  NeighborSearch search;
  NeighborList list;
  if (!search.Build(cell, 0, p, list).ok()) {
    return std::nullopt;  // positions and cell are ParsePacking's to judge
  }
  PackingOverlap worst;
  double deepest = 0;  // smaller radii
  for (int s = 0; s < list.size(); ++s) {
    const auto q = static_cast<std::size_t>(s);
    const auto i = static_cast<std::size_t>(list.first[q]);
    const auto j = static_cast<std::size_t>(list.second[q]);
    const int code = list.image[q];
    const int shift[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    const double dx = p.x[j] - p.x[i] + shift[0] * cell.length[0];
    const double dy = p.y[j] - p.y[i] + shift[1] * cell.length[1];
    const double dz = p.z[j] - p.z[i] + shift[2] * cell.length[2];
    const double overlap = p.radius[i] + p.radius[j] - std::sqrt(dx * dx + dy * dy + dz * dz);
    const double share = overlap / std::min(p.radius[i], p.radius[j]);
    if (!(share > kDeepest)) {
      continue;
    }
    ++worst.pairs;
    if (share > deepest) {
      deepest = share;
      worst.first = std::min(p.id[i], p.id[j]);
      worst.second = std::max(p.id[i], p.id[j]);
      worst.overlap = overlap;
    }
  }
  return worst.pairs > 0 ? std::optional(worst) : std::nullopt;
}

}  // namespace calib::dem
