#include "server/diagnosis/test_plans.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/campaign/file/text/yaml_text.h"

namespace calib::diagnosis {
namespace {

campaign::Experiment Triaxial(double pressure) {
  campaign::Experiment experiment;
  experiment.name = "dense";
  experiment.test = "triaxial_drained";
  experiment.settings["confining_pressure"] = pressure;
  experiment.control_name = "axial_strain";
  experiment.control = {0, 0.05, 0.1};
  experiment.observables.push_back(
      {.name = "q_over_p", .values = {0, 1, 1}, .sd = {0.1, 0.1, 0.3}});
  dem::PackingRecipe recipe;
  recipe.porosity = 0.4;
  experiment.specimens = {recipe, recipe};
  return experiment;
}

campaign::Campaign Measured() {
  campaign::Campaign campaign;
  campaign.experiments = {Triaxial(1e5), Triaxial(4e5)};
  return campaign;
}

int Count(const std::vector<TestPlan>& plans, const auto& condition) {
  return static_cast<int>(std::count_if(plans.begin(), plans.end(), condition));
}

TEST(TestPlans, GridOfPressureDensityAndUnloading) {
  const std::vector<TestPlan> plans = Named(PlansFor(Measured()), 1);
  const auto at = [](double pressure) {
    return [pressure](const TestPlan& plan) {
      return plan.experiment.test == "triaxial_drained" &&
             std::abs(plan.experiment.settings.at("confining_pressure") / pressure - 1) < 1e-9;
    };
  };
  EXPECT_EQ(Count(plans, at(1e5 / 4)), 1);
  EXPECT_EQ(Count(plans, at(4 * 4e5)), 1);
  EXPECT_EQ(Count(plans, at(2e5)), 4);  // looser, denser, with an early and a late unloading
  for (const double porosity : {0.38, 0.42}) {
    EXPECT_EQ(Count(plans,
                    [porosity](const TestPlan& plan) {
                      const auto& settings = plan.experiment.settings;
                      return settings.contains("porosity") &&
                             std::abs(settings.at("porosity") - porosity) < 1e-9;
                    }),
              1);
  }
  EXPECT_GE(Count(plans, [](const TestPlan& p) { return p.experiment.test != "triaxial_drained"; }),
            1);
  for (const TestPlan& plan : plans) {
    const std::vector<double>& strains = plan.experiment.path;
    EXPECT_GE(strains.size(), 40U);
    EXPECT_EQ(std::is_sorted(strains.begin(), strains.end()), !plan.experiment.unloading_at);
    EXPECT_NEAR(strains.back(), plan.experiment.test == "oedometric" ? 0.03 : 0.1, 1e-9);
  }
}

TEST(TestPlans, SpecimensFromAFileKeepTheirDensity) {
  campaign::Campaign campaign = Measured();
  for (auto& experiment : campaign.experiments) experiment.specimens = {campaign::PackingFile{}};
  const std::vector<TestPlan> plans = Named(PlansFor(campaign), 1);
  EXPECT_FALSE(plans.empty());
  EXPECT_EQ(
      Count(plans, [](const TestPlan& p) { return p.experiment.settings.contains("porosity"); }),
      0);
}

TEST(TestPlans, ARateIsVariedAndKeptByTheOthers) {
  campaign::Campaign campaign = Measured();
  for (auto& experiment : campaign.experiments) experiment.loading_rate = 2;
  const std::vector<TestPlan> plans = Named(PlansFor(campaign), 1);
  const auto original = campaign::ParseYaml("name: dense\nloading_rate: 2 1/s\n");
  for (const double rate : {0.5, 8.0}) {
    const auto at = std::find_if(plans.begin(), plans.end(), [rate](const TestPlan& plan) {
      const auto& settings = plan.experiment.settings;
      return settings.contains("loading_rate") && settings.at("loading_rate") == rate;
    });
    ASSERT_NE(at, plans.end()) << rate;
    const auto entry = EntryFor(*at, PatternOf(campaign), *original.root);
    EXPECT_EQ(std::stod(campaign::YamlFind(entry, "loading_rate")->scalar), rate);
  }
  EXPECT_EQ(campaign::YamlFind(EntryFor(plans.front(), PatternOf(campaign), *original.root),
                               "loading_rate")
                ->scalar,
            "2 1/s");
}

TEST(TestPlans, WhatIsPlannedStaysWhereAParameterSetsItInAllTests) {
  campaign::Campaign campaign = Measured();
  campaign.parameters = {
      {.name = "confining_pressure",
       .unit = "Pa",
       .prior = {.min = 9e4, .max = 1.1e5},
       .setting = campaign::SettingOf{.number = "confining_pressure", .experiments = {"dense"}}}};
  const std::vector<TestPlan> plans = Named(PlansFor(campaign), 1);
  const auto named = EntryNamed("experiments: [{name: dense}]\n", campaign, "dense");
  ASSERT_TRUE(named.has_value());
  EXPECT_DOUBLE_EQ(std::stod(campaign::YamlFind(*named, "confining_pressure")->scalar), 1e5);
  const auto kept = [&](double pressure) {
    const auto plan = std::find_if(plans.begin(), plans.end(), [pressure](const TestPlan& one) {
      return std::abs(one.experiment.settings.at("confining_pressure") / pressure - 1) < 1e-9;
    });
    const auto entry = EntryFor(*plan, campaign.experiments.front(), *named, campaign);
    const auto* names = campaign::YamlFind(entry, "as_stated");
    return names == nullptr ? std::string() : names->items.front().scalar;
  };
  EXPECT_EQ(kept(4 * 4e5), "confining_pressure");
}

TEST(TestPlans, AnInitialStressGrowsWithThePressure) {
  campaign::Campaign campaign = Measured();
  for (auto& experiment : campaign.experiments) {
    experiment.initial_stress = dem::InitialStress{.axial = 2e5, .lateral = 1e5};
  }
  const std::vector<TestPlan> plans = Named(PlansFor(campaign), 1);
  const auto low = std::find_if(plans.begin(), plans.end(), [](const TestPlan& plan) {
    return std::abs(plan.experiment.settings.at("confining_pressure") - 1e5 / 4) < 1e-6;
  });
  ASSERT_NE(low, plans.end());
  const auto original = campaign::ParseYaml("initial_stress: {axial: 0.2 MPa, lateral: 0.1 MPa}\n");
  const auto entry = EntryFor(*low, PatternOf(campaign), *original.root);
  const auto* stress = campaign::YamlFind(entry, "initial_stress");
  EXPECT_DOUBLE_EQ(std::stod(campaign::YamlFind(*stress, "axial")->scalar), 5e4);
  EXPECT_DOUBLE_EQ(std::stod(campaign::YamlFind(*stress, "lateral")->scalar), 2.5e4);
}

TEST(TestPlans, AnExtensionStaysOne) {
  campaign::Campaign campaign = Measured();
  for (auto& experiment : campaign.experiments) experiment.control = {0, -0.05, -0.1};
  EXPECT_DOUBLE_EQ(PlansFor(campaign).front().path.back(), -0.1);
}

TEST(TestPlans, FileHoldsTheControlAndNamesWhatWasRead) {
  const campaign::Campaign campaign = Measured();
  PlannedExperiment planned;
  planned.control = "axial_strain";
  planned.path = {0.01, 0.02};
  EXPECT_EQ(DataOf(planned, PatternOf(campaign)), "axial_strain,q_over_p\n0.01,1\n0.02,1\n");
}

TEST(TestPlans, EntryKeepsWhatThePlanDoesNotChange) {
  const auto original = campaign::ParseYaml(R"(name: dense
test: triaxial_drained
confining_pressure: 0.1 MPa
role: validate
packing: {generate: {particles: 300, void_ratio: 0.66, seed: 3}}
data: {file: old.csv}
observables:
  q_over_p: {noise: {column: q_sd}}
)");
  ASSERT_TRUE(original.root);
  const campaign::Campaign campaign = Measured();
  const std::vector<TestPlan> plans = Named(PlansFor(campaign), 1);
  const auto denser = std::find_if(plans.begin(), plans.end(), [](const TestPlan& plan) {
    return plan.experiment.settings.contains("porosity");
  });
  ASSERT_NE(denser, plans.end());
  const std::string text = campaign::ToYaml(EntryFor(*denser, PatternOf(campaign), *original.root));
  for (const char* kept :
       {"particles: 300", "seed: 3", "porosity: 0.42", "confining_pressure: 2"}) {
    EXPECT_NE(text.find(kept), std::string::npos) << kept << " in\n" << text;
  }
  for (const char* gone : {"void_ratio", "role", "old.csv", "q_sd"}) {
    EXPECT_EQ(text.find(gone), std::string::npos) << gone << " in\n" << text;
  }
  // The mean of the old readings' errors.
  EXPECT_NE(text.find("absolute: 0.1666"), std::string::npos) << text;
}

TEST(TestPlans, ACovarianceOfOldReadingsBecomesItsMeanAndLength) {
  constexpr double kLength = 0.02;
  campaign::Campaign campaign = Measured();
  campaign::Experiment& pattern = campaign.experiments[0];
  const auto n = static_cast<Eigen::Index>(pattern.control.size());
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      covariance(i, j) = std::exp(-std::abs(pattern.control[static_cast<std::size_t>(i)] -
                                            pattern.control[static_cast<std::size_t>(j)]) /
                                  kLength);
    }
  }
  for (auto& observable : pattern.observables) observable.covariance = covariance;
  const auto original =
      campaign::ParseYaml("name: a\nobservables:\n  q_over_p: {noise: {covariance: c.txt}}\n");
  ASSERT_TRUE(original.root);
  const std::string text =
      campaign::ToYaml(EntryFor(Named(PlansFor(campaign), 1).front(), pattern, *original.root));
  EXPECT_EQ(text.find("c.txt"), std::string::npos) << text;
  EXPECT_NE(text.find("correlation_length: 0.02"), std::string::npos) << text;
}

}  // namespace
}  // namespace calib::diagnosis
