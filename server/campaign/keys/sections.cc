#include "server/campaign/keys/sections.h"

#include <array>
#include <cassert>
#include <cstddef>
#include <utility>

namespace calib::campaign {
namespace {

constexpr std::array kParts = {SectionsOfCampaign,    SectionsOfModel, SectionsOfEffects,
                               SectionsOfExperiments, SectionsOfData,  SectionsOfInference};

std::vector<Section> AllSections() {
  std::vector<Section> all;
  for (auto part : kParts) {
    for (Section& section : part()) all.push_back(std::move(section));
  }
  return all;
}

}  // namespace

std::vector<Section> Sections(const MethodList& methods) {
  std::vector<Section> all = AllSections();
  Section inference = InferenceSection(methods);
  std::vector<Section> of_methods = std::exchange(inference.of_keys, {});
  const auto place = all.end() - static_cast<std::ptrdiff_t>(SectionsOfInference().size());
  all.insert(place, std::move(inference));
  for (Section& section : of_methods) all.push_back(std::move(section));
  return all;
}

const Section& SectionOf(std::string_view name) {
  static const std::vector<Section> all = AllSections();
  for (const Section& section : all) {
    if (section.name == name) return section;
  }
  assert(false);
  static const Section kNone;
  return kNone;
}

}  // namespace calib::campaign
