#pragma once
// All keys of the campaign file, section by section.

#include <string_view>
#include <vector>

#include "server/campaign/keys/key.h"
#include "server/campaign/model/method.h"

namespace calib::campaign {

/// In the order of the reference; the first is the file itself. `inference` has the keys of all
/// methods, and the sections that these speak of follow it.
std::vector<Section> Sections(const MethodList& methods);

/// The section of this name, which has to be one; not `inference`, which depends on the methods.
/// Thread-safe; what is given back lives as long as the program.
const Section& SectionOf(std::string_view name);

/// `inference`, with what its keys speak of as `of_keys`.
Section InferenceSection(const MethodList& methods);

// The parts that Sections() consists of, but for InferenceSection().
std::vector<Section> SectionsOfCampaign();
std::vector<Section> SectionsOfModel();
std::vector<Section> SectionsOfEffects();
std::vector<Section> SectionsOfExperiments();
std::vector<Section> SectionsOfData();
std::vector<Section> SectionsOfInference();

}  // namespace calib::campaign
