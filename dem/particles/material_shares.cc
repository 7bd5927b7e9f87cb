#include "dem/particles/material_shares.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "dem/particles/random_numbers.h"

namespace calib::dem {

void DrawMaterials(const std::map<std::string, double>& shares, std::uint64_t seed,
                   Packing& packing) {
  if (shares.empty()) {
    return;
  }
  const std::size_t n = packing.x.size();
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < n; ++i) {
    order.emplace_back(Uniform(seed, kMaterialDraw, static_cast<int>(i), 0)[0], i);
  }
  std::sort(order.begin(), order.end());
  packing.material.assign(n, "");
  auto next = order.begin();
  double share = 0;
  for (const auto& [name, part] : shares) {
    share += part;  // rounded in all, so that shares of 1 leave no grain over
    const auto end = order.begin() + std::lround(std::min(share, 1.0) * static_cast<double>(n));
    for (; next < end; ++next) {
      packing.material[next->second] = name;
    }
  }
}

}  // namespace calib::dem
