#include "server/campaign/model/specimen_notes.h"

#include <algorithm>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/registry/catalog.h"
#include "server/campaign/model/replicates.h"

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

std::string ScatterLeftOut(const Campaign& campaign) {
  const bool packings = std::any_of(
      campaign.experiments.begin(), campaign.experiments.end(),
      [](const Experiment& e) { return e.role == Role::kCalibrate && e.specimens.size() > 1; });
  if (campaign.precomputed ||
      (!packings && (VariesPackings(campaign) || ReplicatesOf(campaign) < 2)))
    return "";
  const std::string what =
      packings ? "what runs on different packings differ by" : "what twins of a run differ by";
  return campaign.method == nullptr ? "" : campaign.method->ScatterLeftOut(campaign, what);
}

std::vector<std::string> SpecimenNotes(const Campaign& campaign) {
  std::vector<std::string> notes;
  for (const Experiment& experiment : campaign.experiments) {
    const std::string text = GeneratedFromFile(experiment);
    if (!text.empty()) notes.push_back(absl::StrCat(experiment.name, ": ", text, "."));
  }
  for (std::string note : {TwinsInWords(campaign), ScatterLeftOut(campaign)}) {
    if (!note.empty()) notes.push_back(std::move(note));
  }
  return notes;
}

}  // namespace calib::campaign
