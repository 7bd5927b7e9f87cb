#pragma once
// What a reader of results should know of the packings that the program made by itself.

#include <string>
#include <vector>

#include "server/campaign/campaign.h"

namespace calib::campaign {

/// "realizations 2 to 4 are other packings of the 1000 grains of sand.txt, generated at its porosity
/// of 0.405"; empty where each realization was given or has a recipe.
std::string GeneratedFromFile(const Experiment& experiment);

/// The same as a sentence for each experiment that has such.
std::vector<std::string> SpecimenNotes(const Campaign& campaign);

}  // namespace calib::campaign
