#include "server/campaign/model/run_settings.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <variant>

#include "absl/strings/match.h"
#include "dem/particles/grading.h"

namespace calib::campaign {
namespace {

constexpr const char* kRecipe = "packing.";
constexpr const char* kShareOf = "materials.grains.";

double MeanOf(const dem::Grading& grading, int particles) {
  const std::vector<double> radii = dem::GradedRadii(grading, particles);
  return std::accumulate(radii.begin(), radii.end(), 0.0) / static_cast<double>(radii.size());
}

void Scale(double factor, dem::PackingRecipe& recipe) {
  for (dem::GradingPoint& point : recipe.grading) point.radius *= factor;
  recipe.mean_radius *= factor;
}

// A log-normal curve is cut off as far below its median as above.
double MedianOf(const dem::Grading& grading) {
  return std::sqrt(grading.front().radius * grading.back().radius);
}

bool Concerns(const std::optional<SettingOf>& setting, const Experiment& experiment) {
  return setting && std::find(setting->experiments.begin(), setting->experiments.end(),
                              experiment.name) != setting->experiments.end();
}

// Every number that the values set in this experiment, in the order of parameters, then of ties.
void ForEachNumber(const Campaign& campaign, const Experiment& experiment,
                   std::span<const double> common,
                   const std::function<void(const std::string&, double)>& take) {
  const std::vector<double> values = ValuesIn(campaign, experiment, common);
  const auto give = [&](const SettingOf& setting, double value) {
    take(setting.number, setting.whole ? std::round(value) : value);
  };
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const auto& setting = campaign.parameters[j].setting;
    if (Concerns(setting, experiment)) give(*setting, values[j]);
  }
  const auto ties_one = [&experiment](const TiedParameter& tied) {
    return Concerns(tied.setting, experiment);
  };
  if (std::none_of(campaign.tied.begin(), campaign.tied.end(), ties_one)) return;
  const std::vector<double> tied = TiedValues(campaign, values);
  for (std::size_t k = 0; k < tied.size(); ++k) {
    if (ties_one(campaign.tied[k])) give(*campaign.tied[k].setting, tied[k]);
  }
}

}  // namespace

bool IsOfRecipe(const std::string& number) { return absl::StartsWith(number, kRecipe); }

void SetNumber(const std::string& number, double value, const Experiment& experiment,
               dem::Scenario& scenario) {
  if (IsOfRecipe(number)) return;
  if (number == experiment.control_name) {
    for (dem::ControlPoint& point : scenario.path) point.target = value;
  } else if (number == kDensityOfGrains) {
    scenario.model.density = value;
  } else if (number == "loading_rate") {
    scenario.loading_rate = value;
  } else if (number == "consolidation.friction_coefficient") {
    scenario.consolidation.friction_coefficient = value;
  } else if (number == "consolidation.porosity") {
    scenario.consolidation.porosity = value;
  } else if (absl::StartsWith(number, "initial_stress.")) {
    if (!scenario.initial_stress) scenario.initial_stress.emplace();
    (number == "initial_stress.axial" ? scenario.initial_stress->axial
                                      : scenario.initial_stress->lateral) = value;
  } else if (number == "staging.rate") {
    scenario.staging.rate = value;
  } else if (number == "staging.step") {
    scenario.staging.step = value;
  } else if (number == "staging.unbalanced") {
    scenario.staging.unbalanced = value;
  } else if (number == "staging.damping_loading") {
    scenario.staging.damping_loading = value;
  } else if (number == "staging.damping_settling") {
    scenario.staging.damping_settling = value;
  } else if (absl::StartsWith(number, kShareOf)) {
    scenario.materials.grains[number.substr(std::string(kShareOf).size())] = value;
  } else {
    scenario.settings[number] = value;
  }
}

void SetNumber(const std::string& number, double value, dem::PackingRecipe& recipe) {
  if (number == "packing.porosity") {
    recipe.porosity = value;
  } else if (number == "packing.void_ratio") {
    recipe.porosity = value / (1 + value);
  } else if (number == "packing.mean_radius") {
    Scale(value / recipe.mean_radius, recipe);
    recipe.mean_radius = value;
  } else if (number == "packing.radius_spread") {
    recipe.radius_spread = value;
  } else if (number == "packing.median_radius") {
    Scale(value / MedianOf(recipe.grading), recipe);
  } else if (number == "packing.log_sd") {
    recipe.grading = dem::LogNormalGrading(MedianOf(recipe.grading), value);
    recipe.mean_radius = MeanOf(recipe.grading, recipe.particles);
  } else if (number == "packing.aspect") {
    recipe.aspect = value;
  } else if (number == "packing.pressure") {
    recipe.pressure = value;
  }
}

void ChangeSettings(const Campaign& campaign, const Experiment& experiment,
                    std::span<const double> values, dem::Scenario& scenario) {
  ForEachNumber(campaign, experiment, values, [&](const std::string& number, double value) {
    SetNumber(number, value, experiment, scenario);
  });
}

std::optional<dem::PackingRecipe> ChangedRecipe(const Campaign& campaign,
                                                const Experiment& experiment, const RunOf& run) {
  if (experiment.specimens.empty()) return std::nullopt;
  const auto index = static_cast<std::size_t>(run.stream) % experiment.specimens.size();
  const auto* own = std::get_if<dem::PackingRecipe>(&experiment.specimens[index]);
  if (own == nullptr) return std::nullopt;
  std::optional<dem::PackingRecipe> recipe;
  ForEachNumber(campaign, experiment, run.values, [&](const std::string& number, double value) {
    if (!IsOfRecipe(number)) return;
    if (!recipe) recipe = *own;
    SetNumber(number, value, *recipe);
  });
  return recipe;
}

}  // namespace calib::campaign
