#include "server/campaign/checks/setting_ends.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>

#include "absl/strings/str_cat.h"
#include "dem/registry/scenario_problems.h"
#include "server/campaign/checks/grain_check.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/run_settings.h"

namespace calib::campaign {
namespace {

constexpr double kTailOfSetting = 0.001;

// Stands for a packing that is still to be made.
dem::Packing AnyPacking() {
  return {.length = {1, 1, 1},
          .x = {0, 0.5},
          .y = {0, 0.5},
          .z = {0, 0.5},
          .radius = {0.1, 0.1},
          .clump = {-1, -1}};
}

// The first thing that the engine refuses of a run; empty: nothing.
std::string WhyImpossible(const Campaign& campaign, const Experiment& experiment,
                          const std::vector<double>& values) {
  const RunOf run{.values = values, .stream = 0};
  dem::Scenario scenario = MakeScenario(campaign, experiment, run);
  if (scenario.packing.x.empty()) scenario.packing = AnyPacking();
  if (const auto problems = dem::ScenarioProblems(scenario); !problems.empty()) {
    return problems.front();
  }
  Experiment changed = experiment;
  if (auto recipe = ChangedRecipe(campaign, experiment, run)) {
    changed.specimens = {*std::move(recipe)};
  }
  for (const SpecimenRemarks& grains : GrainRemarksOf(changed, scenario)) {
    if (!grains.remarks.refused.empty()) return grains.remarks.refused.front();
  }
  return "";
}

std::string WhyNoSetting(const CalibratedParameter& parameter, const Experiment& experiment) {
  if (parameter.setting->number != experiment.control_name || experiment.path.size() == 1) {
    return "";
  }
  return absl::StrCat("is the control of ", experiment.name, ", which has ",
                      experiment.control.size(),
                      " readings; a control is calibrated where there is one");
}

std::string WhyNotAtEnds(const Campaign& campaign, const Experiment& experiment, std::size_t j) {
  const CalibratedParameter& parameter = campaign.parameters[j];
  const inference::Prior& prior = parameter.prior;
  // A normal reaches the bounds where it is cut off, those of the number itself too, with no mass.
  const bool by_bounds = prior.kind == inference::PriorKind::kUniform ||
                         prior.kind == inference::PriorKind::kLogUniform;
  for (const double end : {by_bounds ? prior.min : prior.Quantile(kTailOfSetting),
                           by_bounds ? prior.max : prior.Quantile(1 - kTailOfSetting)}) {
    std::vector<double> values = MiddleValues(campaign);
    values[j] = end;
    const std::string why = WhyImpossible(campaign, experiment, values);
    if (why.empty()) continue;
    return absl::StrCat(
        "makes ", experiment.name, " impossible at ", end, parameter.unit == "1" ? "" : " ",
        parameter.unit == "1" ? "" : parameter.unit, ", an end of its prior: ", why);
  }
  return "";
}

}  // namespace

std::vector<ImpossibleEnd> ImpossibleEnds(const Campaign& campaign) {
  std::vector<ImpossibleEnd> found;
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const CalibratedParameter& parameter = campaign.parameters[j];
    if (!parameter.setting) continue;
    for (const Experiment& experiment : campaign.experiments) {
      const auto& concerned = parameter.setting->experiments;
      if (std::find(concerned.begin(), concerned.end(), experiment.name) == concerned.end()) {
        continue;
      }
      std::string why = WhyNoSetting(parameter, experiment);
      if (why.empty()) why = WhyNotAtEnds(campaign, experiment, j);
      if (why.empty()) continue;
      found.push_back({parameter.name, why});
      break;
    }
  }
  return found;
}

}  // namespace calib::campaign
