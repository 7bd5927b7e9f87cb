#include "server/campaign/keys/sections.h"

#include <cassert>
#include <utility>

namespace calib::campaign {
namespace {

std::vector<Section> AllSections() {
  std::vector<Section> all;
  for (auto part : {SectionsOfCampaign, SectionsOfModel, SectionsOfEffects, SectionsOfExperiments,
                    SectionsOfData, SectionsOfInference}) {
    for (Section& section : part()) all.push_back(std::move(section));
  }
  return all;
}

}  // namespace

const std::vector<Section>& Sections() {
  static const std::vector<Section> all = AllSections();
  return all;
}

const Section& SectionOf(std::string_view name) {
  for (const Section& section : Sections()) {
    if (section.name == name) return section;
  }
  assert(false);
  static const Section kNone;
  return kNone;
}

}  // namespace calib::campaign
