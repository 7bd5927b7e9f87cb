#pragma once
// Spheres thrown at random into a periodic cell without touching: where packings begin.

#include "absl/status/statusor.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Radii uniform in mean_radius (1 -/+ radius_spread), placed by random sequential addition,
/// largest first, in a cell of the recipe's aspect with the given solid fraction (0 < fraction <=
/// 0.3 leaves every grain a place quickly). Deterministic: Philox with key = seed, counter = draw
/// [Salmon et al. 2011]. Errors: RESOURCE_EXHAUSTED when a grain finds no place in 100 000
/// attempts.
absl::StatusOr<Packing> RandomCloud(const PackingRecipe& recipe, double solid_fraction);

}  // namespace calib::dem
