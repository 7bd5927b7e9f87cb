#pragma once
// What a reader of results should know of the packings that the program made by itself, and of what
// packings differ by.

#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// "realizations 2 to 4 are other packings of the 1000 grains of sand.txt, generated at its
/// porosity of 0.405"; empty where each realization was given or has a recipe.
std::string GeneratedFromFile(const Experiment& experiment);

/// One sentence where calibrated runs are on several packings, or twins on one are run, and what
/// they differ by is in no error of the method; else empty. A posterior from the emulator contains
/// it whatever the errors.
std::string ScatterLeftOut(const Campaign& campaign);

/// GeneratedFromFile() as a sentence for each experiment that has such, then TwinsInWords(), then
/// ScatterLeftOut().
std::vector<std::string> SpecimenNotes(const Campaign& campaign);

}  // namespace calib::campaign
