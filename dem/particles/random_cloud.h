#pragma once
// Spheres thrown at random into a periodic cell without touching: where packings begin.

#include <vector>

#include "absl/status/statusor.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Porosity of the densest cloud [-]. Chosen: random sequential addition still finds every grain a
/// place quickly.
inline constexpr double kCloudPorosity = 0.7;

/// Radii [m] of the recipe's grains: given one by one, by a grading curve, largest first, or drawn
/// uniformly in mean_radius (1 -/+ radius_spread). Pure.
std::vector<double> RadiiOf(const PackingRecipe& recipe);

/// RadiiOf(recipe), placed by random sequential addition, largest first, in a cell of the recipe's
/// shape with the given solid fraction (0 < fraction <= 1 - kCloudPorosity).
/// Deterministic: Philox with key = seed, counter = draw.
/// [Salmon et al. 2011]
/// Errors: RESOURCE_EXHAUSTED when a grain finds no place in 100 000 attempts.
absl::StatusOr<Packing> RandomCloud(const PackingRecipe& recipe, double solid_fraction);

}  // namespace calib::dem
