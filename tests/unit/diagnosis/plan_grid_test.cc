#include "server/diagnosis/plan_grid.h"

#include <gtest/gtest.h>

#include <algorithm>

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
  driven.control = "impact_speed";
  driven.settings["impact_angle"] = 0.3;
  PlannedExperiment faster = kAsDone;
  faster.settings["impact_speed"] = 4;
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

TEST(PlanGrid, NothingGoesTogetherWithOneChange) {
  EXPECT_TRUE(GridOf(kAsDone, {}).empty());
  EXPECT_TRUE(GridOf(kAsDone, {Under(8e5), Under(0.5e5)}).empty());
}

}  // namespace
}  // namespace calib::diagnosis
