#include "server/diagnosis/plan_grid.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnosis/plan_words.h"

namespace calib::diagnosis {
namespace {

const PlannedExperiment kAsDone{.test = "triaxial_drained",
                                .settings = {{"confining_pressure", 2e5}},
                                .control = "axial_strain",
                                .path = {0.05, 0.1}};

PlannedExperiment Under(double pressure) {
  PlannedExperiment planned = kAsDone;
  planned.settings["confining_pressure"] = pressure;
  return planned;
}

PlannedExperiment Denser() {
  PlannedExperiment planned = kAsDone;
  planned.settings["porosity"] = 0.38;
  return planned;
}

PlannedExperiment Unloaded(double at) {
  PlannedExperiment planned = kAsDone;
  planned.path = {at / 2, at, at / 2, at, 0.1};
  planned.unloading_at = at;
  return planned;
}

PlannedExperiment Oedometric() {
  PlannedExperiment planned = kAsDone;
  planned.test = "oedometric";
  planned.path = {0.01, 0.03};
  return planned;
}

TEST(PlanGrid, WhatBothChangeIsChangedTogether) {
  const auto both = Together(kAsDone, Denser(), Unloaded(0.05));
  ASSERT_TRUE(both);
  EXPECT_EQ(both->settings.at("porosity"), 0.38);
  EXPECT_EQ(both->settings.at("confining_pressure"), 2e5);
  EXPECT_EQ(both->unloading_at, 0.05);
  EXPECT_EQ(both->path, Unloaded(0.05).path);
  // The other test keeps its own way and takes the pressure.
  const auto other = Together(kAsDone, Under(8e5), Oedometric());
  ASSERT_TRUE(other);
  EXPECT_EQ(other->test, "oedometric");
  EXPECT_EQ(other->path, Oedometric().path);
  EXPECT_EQ(other->settings.at("confining_pressure"), 8e5);
}

TEST(PlanGrid, OneThingHasOneValue) {
  EXPECT_FALSE(Together(kAsDone, Under(1e5), Under(8e5)));
  EXPECT_FALSE(Together(kAsDone, Unloaded(0.05), Unloaded(0.02)));
  EXPECT_FALSE(Together(kAsDone, Oedometric(), Unloaded(0.05)));
  EXPECT_FALSE(Together(kAsDone, Denser(), Denser()));
  EXPECT_FALSE(Together(kAsDone, kAsDone, Denser()));
}

TEST(PlanGrid, WhatDrivesATestIsNoSettingOfIt) {
  PlannedExperiment driven = kAsDone;
  driven.control = "impact_velocity";
  driven.settings["impact_angle"] = 0.3;
  PlannedExperiment faster = kAsDone;
  faster.settings["impact_velocity"] = 4;
  EXPECT_FALSE(Together(kAsDone, driven, faster));
}

TEST(PlanGrid, TheThreeBestChangesInEveryCombination) {
  const auto grid = GridOf(
      kAsDone, {Under(8e5), Under(0.5e5), Denser(), Unloaded(0.05), Unloaded(0.02), Oedometric()});
  ASSERT_EQ(grid.size(), 4U);
  EXPECT_EQ(std::count_if(grid.begin(), grid.end(),
                          [](const auto& p) { return p.settings.at("confining_pressure") == 8e5; }),
            3);
  EXPECT_EQ(std::count_if(grid.begin(), grid.end(),
                          [](const auto& p) { return p.settings.contains("porosity"); }),
            3);
  EXPECT_EQ(
      std::count_if(grid.begin(), grid.end(), [](const auto& p) { return p.unloading_at == 0.05; }),
      3);
  EXPECT_TRUE(
      std::none_of(grid.begin(), grid.end(), [](const auto& p) { return p.unloading_at == 0.02; }));
}

TEST(PlanWords, SayWhatIsSetAndHowTheControlGoes) {
  const auto both = Together(kAsDone, Under(8e5), Unloaded(0.05));
  ASSERT_TRUE(both);
  EXPECT_EQ(InWords(*both),
            "triaxial_drained, confining pressure 800 kPa, one unloading and reloading at 5 %");
  EXPECT_EQ(WayInWords(*both), "axial strain to 5 %, back to 2.5 %, then to 10 %");
  EXPECT_EQ(WayInWords(kAsDone), "axial strain to 10 %");
  const PlannedExperiment collision{
      .test = "collision", .settings = {}, .control = "impact_angle", .path = {0.1, 0.2, 0.3}};
  EXPECT_EQ(WayInWords(collision), "impact angle at 3 values from 5.73 deg to 17.2 deg");
}

TEST(PlanGrid, NothingGoesTogetherWithOneChange) {
  EXPECT_TRUE(GridOf(kAsDone, {}).empty());
  EXPECT_TRUE(GridOf(kAsDone, {Under(8e5), Under(0.5e5)}).empty());
}

}  // namespace
}  // namespace calib::diagnosis
