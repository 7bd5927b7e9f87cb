#pragma once
// The keys `packing` and `realizations` of an experiment.

#include <vector>

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// {file: F}, {files: [F, ...]} or {generate: {...}}; realizations: R makes R packings of a recipe
/// (seeds seed .. seed + R - 1) or takes the first R of the files, and where these are fewer other
/// packings of their grains, of each file in turn. `poured`: the test takes only the sizes of the
/// grains, a recipe has no porosity.
std::vector<Specimen> ReadSpecimens(MapReader& experiment, bool poured, ReadContext& context);

}  // namespace calib::campaign
