#include "server/campaign/checks/grain_check.h"

#include "dem/particles/random_cloud.h"
#include "server/campaign/model/race.h"

namespace calib::campaign {

dem::Scenario MiddleScenario(const Campaign& campaign, const Experiment& experiment,
                             const std::vector<std::string>& with) {
  return MakeScenario(campaign, experiment, {.values = MiddleValues(campaign, with), .stream = 0});
}

std::vector<SpecimenRemarks> GrainRemarksOf(const Experiment& experiment,
                                            const dem::Scenario& scenario) {
  std::vector<SpecimenRemarks> all;
  const auto add = [&](const std::string& path, const std::vector<double>& radii) {
    if (radii.empty()) return;
    all.push_back({path, static_cast<int>(radii.size()), dem::GrainRemarksOf(scenario, radii)});
  };
  bool recipe_seen = false;
  for (const Specimen& specimen : experiment.specimens) {
    if (const auto* file = std::get_if<PackingFile>(&specimen)) {
      add(file->path, file->packing.radius);
    } else if (const auto* recipe = std::get_if<dem::PackingRecipe>(&specimen);
               recipe != nullptr && !recipe_seen) {
      recipe_seen = true;
      add("", dem::RadiiOf(*recipe));
    }
  }
  return all;
}

}  // namespace calib::campaign
