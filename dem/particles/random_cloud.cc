#include "dem/particles/random_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

/// Placed grains by grid cells of at least the largest diameter.
class PlacedGrains {
 public:
  PlacedGrains(const Packing& packing, double largest_diameter) : packing_(packing) {
    for (std::size_t a = 0; a < 3; ++a) {
      count_[a] = std::max(1, static_cast<int>(packing.length[a] / largest_diameter));
    }
    cells_.resize(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2]);
  }

  [[nodiscard]] bool Touches(const std::array<double, 3>& centre, double radius) const {
    const std::array<int, 3> home = CellOf(centre);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          for (const int grain : cells_[Index({home[0] + dx, home[1] + dy, home[2] + dz})]) {
            if (Overlap(centre, radius, static_cast<std::size_t>(grain))) {
              return true;
            }
          }
        }
      }
    }
    return false;
  }

  void Add(const std::array<double, 3>& centre, int grain) {
    cells_[Index(CellOf(centre))].push_back(grain);
  }

 private:
  [[nodiscard]] std::array<int, 3> CellOf(const std::array<double, 3>& centre) const {
    std::array<int, 3> cell{};
    for (std::size_t a = 0; a < 3; ++a) {
      cell[a] =
          std::min(static_cast<int>(centre[a] / packing_.length[a] * count_[a]), count_[a] - 1);
    }
    return cell;
  }

  [[nodiscard]] std::size_t Index(std::array<int, 3> cell) const {
    for (std::size_t a = 0; a < 3; ++a) {
      cell[a] = (cell[a] + count_[a]) % count_[a];
    }
    return static_cast<std::size_t>(cell[0]) +
           static_cast<std::size_t>(count_[0]) *
               (static_cast<std::size_t>(cell[1]) +
                static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(cell[2]));
  }

  [[nodiscard]] bool Overlap(const std::array<double, 3>& centre, double radius,
                             std::size_t grain) const {
    const std::array<double, 3> other = {packing_.x[grain], packing_.y[grain], packing_.z[grain]};
    double distance2 = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double d = std::abs(centre[a] - other[a]);
      const double nearest = std::min(d, packing_.length[a] - d);
      distance2 += nearest * nearest;
    }
    const double reach = radius + packing_.radius[grain];
    return distance2 < reach * reach;
  }

  const Packing& packing_;
  std::array<int, 3> count_{};
  std::vector<std::vector<int>> cells_;
};

}  // namespace

std::vector<double> RadiiOf(const PackingRecipe& recipe) {
  if (!recipe.radii.empty()) {
    return recipe.radii;
  }
  if (!recipe.grading.empty()) {
    return GradedRadii(recipe.grading, recipe.particles);
  }
  std::vector<double> radii;
  for (int i = 0; i < recipe.particles; ++i) {
    const double u = Uniform(recipe.seed, kRadiusDraw, i, 0)[0];
    radii.push_back(recipe.mean_radius * (1 + recipe.radius_spread * (2 * u - 1)));
  }
  return radii;
}

absl::StatusOr<Packing> RandomCloud(const PackingRecipe& recipe, double solid_fraction) {
  Packing packing;
  const int n = recipe.particles;
  packing.radius = RadiiOf(recipe);
  double solid = 0;
  for (const double r : packing.radius) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  std::sort(packing.radius.begin(), packing.radius.end(), std::greater<>());
  const double width = CubeRoot(solid / solid_fraction / recipe.aspect / recipe.depth_ratio);
  packing.length[0] = width;
  packing.length[1] = recipe.depth_ratio * width;
  packing.length[2] = recipe.aspect * width;
  packing.clump.assign(static_cast<std::size_t>(n), -1);

  PlacedGrains placed(packing, 2 * packing.radius.front());
  /// Places that are tried for a grain [-]. Chosen: clouds up to 1 - kCloudPorosity find one long
  /// before.
  constexpr int kAttempts = 100'000;
  for (int i = 0; i < n; ++i) {
    bool found = false;
    for (int attempt = 0; attempt < kAttempts && !found; ++attempt) {
      std::array<double, 3> centre = Uniform(recipe.seed, kPositionDraw, i, attempt);
      for (std::size_t a = 0; a < 3; ++a) {
        centre[a] *= packing.length[a];
      }
      if (placed.Touches(centre, packing.radius[static_cast<std::size_t>(i)])) {
        continue;
      }
      packing.x.push_back(centre[0]);
      packing.y.push_back(centre[1]);
      packing.z.push_back(centre[2]);
      placed.Add(centre, i);
      found = true;
    }
    if (!found) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no place for grain ", i, " of ", n, " at solid fraction ", solid_fraction));
    }
  }
  return packing;
}

}  // namespace calib::dem
