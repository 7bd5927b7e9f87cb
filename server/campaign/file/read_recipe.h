#pragma once
// The key `packing.generate` of an experiment: how its specimen is made.

#include <optional>

#include "dem/particles/packing.h"
#include "server/campaign/file/shared/map_reader.h"

namespace calib::campaign {

/// {particles, porosity | void_ratio, radii | diameters, aspect, pressure, seed}; sizes by {mean,
/// spread}, {cumulative: [[size, share of the mass that is finer], ...]} or {median, log_sd}.
/// `poured`: the test takes only the sizes of the grains. Empty after a problem.
std::optional<dem::PackingRecipe> ReadRecipe(MapReader& map, bool poured);

}  // namespace calib::campaign
