// Every number of every test, calibrated: it changes what a run is, and what it gives.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/model/run_settings.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"

namespace calib::messages {
namespace {

using campaign::ExperimentNumber;

// Of the control of a test.
double Reading(const dem::TestInfo& test) {
  if (test.control_range && test.control_range->whole)
    return std::max(1.0, test.control_range->min);
  if (test.control_range) return std::clamp(0.01, test.control_range->min, test.control_range->max);
  return test.stress_driven ? 3e5 : 0.01;
}

std::string SizesOf(const std::string& sizes) {
  return sizes.empty() ? "radii: {mean: 1 mm}" : sizes;
}

// One experiment of a test; `further` stands in it.
std::string FileOf(const dem::TestInfo& test, const std::string& parameters,
                   const std::string& further = "", const std::string& sizes = "") {
  std::string observed;
  for (const std::string& name : test.observables) {
    if (name != test.control) observed = name;
  }
  std::string settings;
  for (const dem::ParameterInfo& setting : test.settings) {
    const bool named = absl::StrContains(parameters, " " + setting.name + ":") ||
                       absl::StrContains(parameters, "." + setting.name + ":");
    if (setting.default_value || named || setting.name == test.control) continue;
    absl::StrAppend(&settings, "    ", setting.name, ": ", setting.unit == "Pa" ? 1e5 : 0.1, "\n");
  }
  std::string packing;
  if (test.needs_packing) {
    const bool porosity = !absl::StrContains(parameters, "packing.porosity") &&
                          !absl::StrContains(parameters, "packing.void_ratio");
    packing =
        absl::StrCat("    packing: {generate: {particles: ", sizes.empty() ? 30 : 400, ", ",
                     test.poured || !porosity ? "" : "porosity: 0.42, ", SizesOf(sizes), "}}\n");
  }
  return absl::StrCat(
      "name: walk\nmodel:\n  contact: hertz_mindlin\n  fixed: {poisson_ratio: 0.2, "
      "friction_coefficient: 0.5}\n  materials: {wood: {young_modulus: 1e8}}\n"
      "parameters:\n  young_modulus: {prior: log_uniform, min: 1e8, max: 1e10}\n",
      parameters, "experiments:\n  - name: a\n    test: ", test.name, "\n", settings, packing,
      further, "    data: {file: data.csv",
      dem::InPeriodicCell(test) ? ", strain: logarithmic" : "", "}\n    control: ", test.control,
      "\n    observables: {", observed, ": {noise: {absolute: 1}}}\n");
}

campaign::ReadOutcome ReadFile(const dem::TestInfo& test, const std::string& yaml) {
  std::string observed;
  for (const std::string& name : test.observables) {
    if (name != test.control) observed = name;
  }
  const std::string data = absl::StrCat(test.control, ",", observed, "\n", Reading(test), ",1\n");
  const auto reader = [&data](const std::string& path) -> absl::StatusOr<std::string> {
    if (path == "data.csv") return data;
    return absl::NotFoundError("no such file");
  };
  // Accepted before: what is useless with these values is not asked.
  return campaign::ReadCampaign(methods::All(), yaml, "c.yaml", reader, std::nullopt,
                                campaign::CampaignIs::kStored);
}

// Two values that the number may have.
std::pair<double, double> TwoValues(const ExperimentNumber& number) {
  if (number.whole) return {number.range.min, number.range.min + 1};
  const double scale = number.unit == "Pa" ? 1e5 : number.unit == "kg/m^3" ? 1e3 : 1;
  const double low = std::isinf(number.range.min) ? 0 : number.range.min;
  const double high = std::isinf(number.range.max) ? low + scale : number.range.max;
  return {low + 0.3 * (high - low), low + 0.6 * (high - low)};
}

std::string PriorOf(const std::string& name, const ExperimentNumber& number) {
  const auto [low, high] = TwoValues(number);
  return absl::StrCat("  ", name, ": {prior: uniform, min: ", low, ", max: ", high, "}\n");
}

std::vector<ExperimentNumber> AllNumbersOf(const dem::TestInfo& test, const std::string& further,
                                           const std::string& sizes) {
  const auto parse = campaign::ParseYaml(FileOf(test, "", further, sizes));
  return NumbersOf(campaign::OutlinesOf(campaign::YamlFind(*parse.root, "experiments")).front());
}

void ExpectOtherRuns(const dem::TestInfo& test, const ExperimentNumber& number,
                     const std::string& further, const std::string& sizes) {
  for (const std::string& name : {number.name, "a." + number.name}) {
    SCOPED_TRACE(absl::StrCat(test.name, ": ", name));
    // Both principal stresses are needed.
    std::string stress;
    if (absl::StartsWith(number.name, "initial_stress") && further.empty()) {
      stress = "    initial_stress: {axial: 2e5, lateral: 1e5}\n";
    }
    const auto outcome =
        ReadFile(test, FileOf(test, PriorOf(name, number), further + stress, sizes));
    for (const campaign::Problem& problem : outcome.problems) {
      ADD_FAILURE() << ToString(problem);
    }
    if (!outcome.problems.empty()) return;
    const auto digest = [&](double value) {
      return SpecDigest(SpecOf(outcome.campaign, 0, {.values = {1e9, value}, .stream = 0}));
    };
    const auto [low, high] = TwoValues(number);
    EXPECT_NE(digest(low), digest(high));
    EXPECT_EQ(digest(low), digest(low));
  }
}

TEST(SettingsWalk, EveryNumberOfEveryTestChangesWhatARunIs) {
  int walked = 0;
  for (const dem::TestInfo& test : dem::Tests()) {
    std::set<std::string> settings;
    for (const ExperimentNumber& number : AllNumbersOf(test, "", "")) {
      ExpectOtherRuns(test, number, "", "");
      settings.insert(number.name);
      ++walked;
    }
    for (const dem::ParameterInfo& setting : test.settings) {
      EXPECT_TRUE(settings.contains(setting.name) || setting.name == test.control)
          << test.name << ": " << setting.name;
    }
  }
  EXPECT_GT(walked, 100);
}

TEST(SettingsWalk, SizesByACurveAndSharesOfMaterialsToo) {
  const dem::TestInfo& test = *dem::FindTest("triaxial_drained");
  const std::string shares = "    materials: {grains: {wood: 0.5}}\n";
  const std::string curve = "radii: {cumulative: [[0.5 mm, 0], [1 mm, 0.4], [2 mm, 1]]}";
  const std::string log_normal = "diameters: {median: 1 mm, log_sd: 0.3}";
  std::set<std::string> names;
  for (const std::string& sizes : {curve, log_normal}) {
    for (const ExperimentNumber& number : AllNumbersOf(test, shares, sizes)) {
      if (!absl::StartsWith(number.name, "packing.") &&
          !absl::StartsWith(number.name, "materials.")) {
        continue;
      }
      ExpectOtherRuns(test, number, shares, sizes);
      names.insert(number.name);
    }
  }
  EXPECT_THAT(names, ::testing::IsSupersetOf({"packing.mean_radius", "packing.median_radius",
                                              "packing.log_sd", "materials.grains.wood"}));
}

TEST(SettingsWalk, NoSettingIsCalledAsAParameterOfALaw) {
  std::set<std::string> parameters;
  for (const dem::ContactInfo& contact : dem::Contacts()) {
    for (const dem::ParameterInfo& info : contact.parameters) parameters.insert(info.name);
  }
  for (const dem::TestInfo& test : dem::Tests()) {
    for (const dem::ParameterInfo& setting : test.settings) {
      EXPECT_FALSE(parameters.contains(setting.name)) << test.name << ": " << setting.name;
    }
  }
}

// All states of a run, one after the other.
std::vector<double> StatesOf(const campaign::Campaign& campaign, double value) {
  const campaign::RunOf run{.values = {1e9, value}, .stream = 0};
  const campaign::Experiment& experiment = campaign.experiments.front();
  dem::Scenario scenario = MakeScenario(campaign, experiment, run);
  if (const auto* own = std::get_if<dem::PackingRecipe>(&experiment.specimens.front())) {
    const auto recipe = ChangedRecipe(campaign, experiment, run).value_or(*own);
    const auto packing = dem::FindTest(scenario.test)->poured ? dem::GenerateSizes(recipe)
                                                              : dem::GeneratePacking(recipe, 1, {});
    EXPECT_TRUE(packing.ok()) << packing.status();
    if (packing.ok()) scenario.packing = *packing;
  }
  std::vector<double> states;
  const auto summary =
      dem::Simulate(scenario,
                    [&states](const dem::State& state) {
                      states.insert(states.end(), state.values.begin(), state.values.end());
                      return absl::OkStatus();
                    },
                    {});
  EXPECT_TRUE(summary.ok()) << summary.status();
  return states;
}

struct Changed {
  const char* test;
  const char* number;
  const char* low;
  const char* high;
  double from, to;
};

TEST(SettingsWalk, ChangesTheStatesOfARun) {
  const std::vector<Changed> changes = {
      {"collision", "radius", "1e-3", "2e-3", 1e-3, 2e-3},
      {"collision", "partner_radius", "1e-3", "2e-3", 1e-3, 2e-3},
      {"collision", "impact_speed", "0.1", "0.2", 0.1, 0.2},
      {"collision", "impact_spin", "0", "10", 0, 10},
      {"collision", "density", "2000", "3000", 2000, 3000},
      {"triaxial_drained", "confining_pressure", "1e5", "2e5", 1e5, 2e5},
      {"triaxial_drained", "consolidation.friction_coefficient", "0.1", "0.4", 0.1, 0.4},
      {"triaxial_drained", "staging.rate", "0.5", "1", 0.5, 1},
      {"triaxial_drained", "packing.porosity", "0.4", "0.43", 0.4, 0.43},
      {"triaxial_drained", "packing.radius_spread", "0.1", "0.3", 0.1, 0.3}};
  for (const Changed& changed : changes) {
    SCOPED_TRACE(absl::StrCat(changed.test, ": ", changed.number));
    const dem::TestInfo& test = *dem::FindTest(changed.test);
    const auto outcome =
        ReadFile(test, FileOf(test, absl::StrCat("  ", changed.number, ": {prior: uniform, min: ",
                                                 changed.low, ", max: ", changed.high, "}\n")));
    for (const campaign::Problem& problem : outcome.problems) {
      ADD_FAILURE() << ToString(problem);
    }
    if (!outcome.problems.empty()) continue;
    const std::vector<double> one = StatesOf(outcome.campaign, changed.from);
    EXPECT_FALSE(one.empty());
    EXPECT_NE(one, StatesOf(outcome.campaign, changed.to));
  }
}

}  // namespace
}  // namespace calib::messages
