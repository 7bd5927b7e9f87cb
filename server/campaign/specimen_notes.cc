#include "server/campaign/specimen_notes.h"

#include <algorithm>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/catalog/catalog.h"

namespace calib::campaign {

std::string GeneratedFromFile(const Experiment& experiment) {
  const auto& all = experiment.specimens;
  const auto first = std::find_if(all.begin(), all.end(), [](const Specimen& specimen) {
    return std::holds_alternative<PackingLike>(specimen);
  });
  if (first == all.end()) return "";
  const auto files = first - all.begin();
  const auto& like = std::get<PackingLike>(*first);
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  const bool poured = test != nullptr && test->poured;
  std::string text =
      files + 1 == std::ssize(all)
          ? absl::StrCat("realization ", files + 1, poured ? " pours" : " is")
          : absl::StrCat("realizations ", files + 1, " to ", all.size(), poured ? " pour" : " are");
  const std::string grains = absl::StrCat(
      "the ", like.recipe.particles, " grains of ", like.path,
      files > 1 ? absl::StrCat(" and the other ", files == 2 ? "file" : "files", " in turn") : "");
  if (poured) return absl::StrCat(text, " ", grains, " anew");
  return absl::StrCat(
      text, files + 1 == std::ssize(all) ? " another packing of " : " other packings of ", grains,
      files > 1 ? ", generated at their porosities"
                : absl::StrFormat(", generated at its porosity of %.3g", like.recipe.porosity));
}

std::vector<std::string> SpecimenNotes(const Campaign& campaign) {
  std::vector<std::string> notes;
  for (const Experiment& experiment : campaign.experiments) {
    const std::string text = GeneratedFromFile(experiment);
    if (!text.empty()) notes.push_back(absl::StrCat(experiment.name, ": ", text, "."));
  }
  return notes;
}

}  // namespace calib::campaign
