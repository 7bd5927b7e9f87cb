#include "server/diagnosis/setting_plans.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/campaign/file/text/yaml_text.h"
#include "server/diagnosis/control_way.h"

namespace calib::diagnosis {
namespace {

campaign::Experiment Collision() {
  campaign::Experiment experiment;
  experiment.name = "ball";
  experiment.test = "collision";
  experiment.settings = {{"radius", 0.002},
                         {"partner_radius", std::numeric_limits<double>::infinity()},
                         {"thickness", 0},
                         {"impact_speed", 3.9},
                         {"impact_spin", 0}};
  experiment.control_name = "impact_angle";
  experiment.control = {0.1, 0.4, 0.7};
  experiment.observables.push_back(
      {.name = "normal_restitution", .values = {0.9, 0.9, 0.9}, .sd = {0.01, 0.01, 0.01}});
  return experiment;
}

std::vector<PlannedExperiment> With(const std::vector<PlannedExperiment>& plans,
                                    const std::string& setting) {
  std::vector<PlannedExperiment> found;
  std::copy_if(plans.begin(), plans.end(), std::back_inserter(found),
               [&setting](const auto& plan) { return plan.settings.contains(setting); });
  return found;
}

TEST(SettingPlans, CollisionsOfOtherBodiesSpeedsAndAngles) {
  const std::vector<PlannedExperiment> plans = SettingPlans(Collision());
  for (const char* setting : {"radius", "impact_speed"}) {
    const auto changed = With(plans, setting);
    ASSERT_EQ(changed.size(), 2U) << setting;
    EXPECT_DOUBLE_EQ(changed[1].settings.at(setting) / changed[0].settings.at(setting), 16);
    EXPECT_EQ(changed[0].path, Collision().control);
  }
  // A wall stays a wall, what does not spin is not spun, no sphere becomes a disk.
  for (const char* kept : {"partner_radius", "impact_spin", "thickness"}) {
    EXPECT_TRUE(With(plans, kept).empty()) << kept;
  }
  const auto wider = std::find_if(plans.begin(), plans.end(), [](const auto& plan) {
    return plan.control == "impact_angle" && plan.settings.empty();
  });
  ASSERT_NE(wider, plans.end());
  EXPECT_DOUBLE_EQ(wider->path.front(), 0.025);
  // Four times 0.7 is no angle to a normal, and nobody measures at the catalogue's end of 1.57.
  EXPECT_DOUBLE_EQ(wider->path.back(), 0.7 + 0.9 * (1.57 - 0.7));
}

TEST(SettingPlans, AnotherControlTakesThePlaceOfItsSetting) {
  const std::vector<PlannedExperiment> plans = SettingPlans(Collision());
  const auto fast = std::find_if(plans.begin(), plans.end(),
                                 [](const auto& plan) { return plan.control == "impact_speed"; });
  ASSERT_NE(fast, plans.end());
  EXPECT_DOUBLE_EQ(fast->settings.at("impact_angle"), 0.4);
  EXPECT_DOUBLE_EQ(fast->path.front(), 3.9 / 4);
  EXPECT_DOUBLE_EQ(fast->path.back(), 3.9 * 4);
  const auto original = campaign::ParseYaml(
      "name: ball\ntest: collision\nimpact_speed: 3.9 m/s\ncontrol: impact_angle\n");
  const std::string entry = campaign::ToYaml(EntryFor(
      {.experiment = *fast, .name = "next_1", .file = "next_1.csv"}, Collision(), *original.root));
  EXPECT_EQ(entry.find("3.9"), std::string::npos) << entry;
  EXPECT_NE(entry.find("control: impact_speed"), std::string::npos) << entry;
  EXPECT_NE(entry.find("impact_angle: 0.4"), std::string::npos) << entry;
}

TEST(SettingPlans, FlowsChangeLittleAndRepetitionsAreNoRange) {
  campaign::Experiment silo;
  silo.test = "silo_discharge";
  silo.settings = {{"silo_width", 0.2}, {"gravity", 9.80665}, {"jam_time", 3}, {"avalanches", 20}};
  silo.control_name = "opening";
  silo.control = {0.03, 0.06};
  const std::vector<PlannedExperiment> plans = SettingPlans(silo);
  ASSERT_EQ(plans.size(), 3U);
  EXPECT_DOUBLE_EQ(plans[1].settings.at("silo_width"), 0.3);
  EXPECT_EQ(plans[2].path.size(), silo.control.size());
  EXPECT_DOUBLE_EQ(plans[2].path.back(), 0.09);

  campaign::Experiment pile;
  pile.test = "angle_of_repose";
  pile.control_name = "repetition";
  pile.control = {1, 2, 3};
  EXPECT_TRUE(SettingPlans(pile).empty());
}

TEST(SettingPlans, AStressGoesOnAndIsTakenOffOnce) {
  campaign::Experiment isotropic;
  isotropic.test = "isotropic";
  isotropic.settings = {{"confining_pressure", 1e5}};
  isotropic.control_name = "mean_stress";
  isotropic.control_start = 1e5;
  isotropic.control = {2e5, 5e5};
  const std::vector<PlannedExperiment> plans = SettingPlans(isotropic);
  ASSERT_EQ(plans.size(), 2U);
  EXPECT_EQ(plans[0].path, Monotonic(1e5, 2e6));
  EXPECT_TRUE(plans[1].unloading_at);
  EXPECT_DOUBLE_EQ(plans[1].path.back(), 5e5);
  EXPECT_GT(plans[1].path.front(), 1e5);
}

TEST(SettingPlans, ShearingUnderAnotherPressureAndAtAnotherRate) {
  campaign::Experiment shear;
  shear.test = "simple_shear";
  shear.settings = {{"confining_pressure", 1e5}, {"constant_volume", 0}};
  shear.control_name = "shear_strain";
  shear.control = {0.01, 0.05, 0.02};  // unloaded already
  shear.loading_rate = 1;
  const std::vector<PlannedExperiment> plans = SettingPlans(shear);
  EXPECT_EQ(With(plans, "confining_pressure").size(), 2U);
  EXPECT_EQ(With(plans, "loading_rate").size(), 2U);
  EXPECT_EQ(plans.size(), 4U);
}

TEST(ControlWay, SpreadInEqualRatiosOrSteps) {
  const std::vector<double> ratios = Spread(1, 100, 3);
  EXPECT_NEAR(ratios[1], 10, 1e-12);
  const std::vector<double> steps = Spread(0, 1, 3);
  EXPECT_DOUBLE_EQ(steps[1], 0.5);
  EXPECT_EQ(Spread(2, 3, 1), std::vector<double>{2});
}

}  // namespace
}  // namespace calib::diagnosis
