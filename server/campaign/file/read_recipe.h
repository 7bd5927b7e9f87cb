#pragma once
// The key `packing.generate` of an experiment: how its specimen is made.

#include <optional>

#include "dem/particles/packing.h"
#include "server/campaign/file/map_reader.h"

namespace calib::campaign {

/// The fewest grains of a specimen.
inline constexpr int kFewestGrains = 20;
/// Porosities and shapes of cells (height or depth over width) that packings are made with.
inline constexpr Range kRecipePorosity{.min = 0.2, .max = 0.6, .min_open = true, .max_open = true};
inline constexpr Range kRecipeAspect{.min = 0.2, .max = 5};

/// {particles, porosity | void_ratio, radii | diameters, aspect, pressure, seed}; sizes by {mean,
/// spread}, {cumulative: [[size, share of the mass that is finer], ...]} or {median, log_sd}.
/// `poured`: the test takes only the sizes of the grains. Empty after a problem.
std::optional<dem::PackingRecipe> ReadRecipe(MapReader& map, bool poured);

}  // namespace calib::campaign
