#include "dem/particles/loose_fill.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

constexpr int kMostLayers = 1'000'000;
constexpr double kPitch = 1.08;   // largest diameters
constexpr double kJitter = 0.03;  // largest radii, either way

void Shuffle(std::vector<double>& radii, std::uint64_t seed) {
  for (std::size_t k = radii.size(); k > 1; --k) {
    const double u = Uniform(seed, kOrderDraw, static_cast<int>(k), 0)[0];
    std::swap(radii[k - 1], radii[static_cast<std::size_t>(u * static_cast<double>(k))]);
  }
}

}  // namespace

Packing LooseFill(std::vector<double> radii, const FillRegion& region, std::uint64_t seed) {
  Packing packing;
  const double largest = *std::max_element(radii.begin(), radii.end());
  Shuffle(radii, seed);
  const double pitch = kPitch * 2 * largest;
  const int nx = std::max(1, static_cast<int>(region.width / pitch));
  const int ny = region.depth > 0 ? std::max(1, static_cast<int>(region.depth / pitch)) : 1;
  const double x0 = region.low.x + 0.5 * (region.width - (nx - 1) * pitch);
  const double y0 = region.low.y + 0.5 * (region.depth - (ny - 1) * pitch);
  std::size_t placed = 0;
  for (int layer = 0; placed < radii.size(); ++layer) {
    const double highest = (layer + 1) * pitch;
    if (region.height > 0 ? highest > region.height : layer > kMostLayers) {
      break;
    }
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx && placed < radii.size(); ++i) {
        const auto u = Uniform(seed, kFillDraw, static_cast<int>(placed), layer);
        const auto shift = [&](std::size_t a) { return kJitter * largest * (2 * u[a] - 1); };
        const Vec3 centre{x0 + i * pitch + shift(0),
                          region.depth > 0 ? y0 + j * pitch + shift(1) : region.low.y,
                          region.low.z + (layer + 0.5) * pitch + shift(2)};
        if (!region.holds(centre, radii[placed])) {
          continue;
        }
        packing.x.push_back(centre.x);
        packing.y.push_back(centre.y);
        packing.z.push_back(centre.z);
        packing.radius.push_back(radii[placed]);
        packing.clump.push_back(-1);
        ++placed;
      }
    }
  }
  return packing;
}

double TopOf(const Packing& packing) {
  double top = packing.z.front();
  for (std::size_t k = 0; k < packing.z.size(); ++k) {
    top = std::max(top, packing.z[k] + packing.radius[k]);
  }
  return top;
}

}  // namespace calib::dem
