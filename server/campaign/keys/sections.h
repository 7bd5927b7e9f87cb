#pragma once
// All keys of the campaign file, section by section.

#include <string_view>
#include <vector>

#include "server/campaign/keys/key.h"

namespace calib::campaign {

/// In the order of the reference; the first is the file itself. Thread-safe; what is given back
/// lives as long as the program.
const std::vector<Section>& Sections();

/// The section of this name, which has to be one.
const Section& SectionOf(std::string_view name);

// The parts that Sections() consists of.
std::vector<Section> SectionsOfCampaign();
std::vector<Section> SectionsOfModel();
std::vector<Section> SectionsOfEffects();
std::vector<Section> SectionsOfExperiments();
std::vector<Section> SectionsOfData();
std::vector<Section> SectionsOfInference();

}  // namespace calib::campaign
