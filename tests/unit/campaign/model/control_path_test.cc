#include "server/campaign/model/control_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace calib::campaign {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<double> Targets(const ControlPath& path) {
  std::vector<double> targets;
  for (const dem::ControlPoint& point : path.points) targets.push_back(point.target);
  return targets;
}

TEST(ControlPath, KeepsAMonotoneControlAsItIs) {
  const std::vector<double> readings = {0, 0.004, 0.005, 0.02, 0.14};
  const ControlPath path = CleanControl(readings, 0, std::nullopt);
  EXPECT_EQ(Targets(path), readings);
  EXPECT_THAT(path.turning, IsEmpty());
  EXPECT_EQ(path.travelled, readings);
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    EXPECT_EQ(path.points[i].load_step, static_cast<int>(i));
  }
}

TEST(ControlPath, FindsTurningPointsOfUnloadReloadCycles) {
  const std::vector<double> readings = {0.5, 1, 1.5, 1.0, 0.7, 1.1, 1.6, 2, 1.2, 0.9};
  const ControlPath path = CleanControl(readings, 0, std::nullopt);
  EXPECT_THAT(path.turning, ElementsAre(2, 4, 7));
  EXPECT_EQ(Targets(path), readings);
  EXPECT_DOUBLE_EQ(path.travelled.back(), 1.5 + 0.8 + 1.3 + 1.1);
  EXPECT_THAT(NameSegments(path, {}),
              ElementsAre("initial_loading", "initial_loading", "initial_loading", "unload_1",
                          "unload_1", "reload_1", "reload_1", "reload_1", "unload_2", "unload_2"));
}

TEST(ControlPath, ReadingsThatNoisePutsOnOneControlStayStates) {
  const ControlPath path = CleanControl({0.010, 0.0201, 0.0199, 0.030, 0.0299}, 0, 1e-4);
  EXPECT_THAT(path.turning, IsEmpty());
  ASSERT_EQ(path.points.size(), 5U);
  EXPECT_DOUBLE_EQ(path.points[1].target, 0.02);
  EXPECT_DOUBLE_EQ(path.points[2].target, 0.02);
  EXPECT_DOUBLE_EQ(path.points[3].target, path.points[4].target);
}

TEST(ControlPath, RemovesNoiseButNotTheCycle) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 2e-5);
  std::vector<double> readings;
  const auto branch = [&](double from, double to) {
    for (int i = 1; i <= 40; ++i) readings.push_back(from + (to - from) * i / 40 + noise(random));
  };
  branch(0, 0.017);
  branch(0.017, 0.010);
  branch(0.010, 0.0172);
  branch(0.0172, 0.009);
  for (const std::optional<double> stated :
       {std::optional<double>(2e-5), std::optional<double>()}) {
    const ControlPath path = CleanControl(readings, 0, stated);
    ASSERT_EQ(path.turning.size(), 3U);
    EXPECT_NEAR(static_cast<double>(path.turning[0]), 39, 2);
    EXPECT_NEAR(static_cast<double>(path.turning[2]), 119, 2);
    for (std::size_t i = 0; i < readings.size(); ++i) {
      EXPECT_NEAR(path.points[i].target, readings[i], 1.5e-4);
    }
    // Monotone between turning points.
    for (std::size_t i = 1; i < path.turning[0]; ++i) {
      EXPECT_GE(path.points[i].target, path.points[i - 1].target);
    }
  }
}

TEST(ControlPath, StressControlStartsAtTheStartPressure) {
  const ControlPath path = CleanControl({2e5, 4e5, 3e5, 5e5}, 1e5, std::nullopt);
  EXPECT_THAT(path.turning, ElementsAre(1, 2));
  EXPECT_THAT(path.travelled, ElementsAre(1e5, 3e5, 4e5, 6e5));
}

TEST(ControlPath, NamesThePeak) {
  const ControlPath path = CleanControl({0, 0.01, 0.02, 0.04, 0.08, 0.12}, 0, std::nullopt);
  EXPECT_THAT(NameSegments(path, {.strength = {0, 0.4, 1.0, 1.4, 1.2, 1.0}}),
              ElementsAre("initial_loading", "initial_loading", "pre_peak", "peak", "post_peak",
                          "post_peak"));
  // A plateau has no peak.
  EXPECT_THAT(NameSegments(path, {.strength = {0, 0.4, 1.0, 1.4, 1.39, 1.39}}),
              Each("initial_loading"));
}

TEST(ControlPath, NamesTheSteadyState) {
  std::vector<double> strain;
  StageCurves curves;
  for (int i = 0; i <= 40; ++i) {
    const double x = 0.005 * i;
    strain.push_back(x);
    // Peak at 3 %, constant from about 12 % on; dilation until then, with scatter of the readings.
    const double jitter = 0.002 * (i % 2 == 0 ? 1 : -1);
    curves.strength.push_back(1 - std::exp(-150 * x) + 20 * x * std::exp(-33 * x) + jitter);
    curves.volume.push_back(-0.05 * (1 - std::exp(-40 * x)));
  }
  const ControlPath path = CleanControl(strain, 0, 1e-6);
  const auto names = NameSegments(path, curves);
  EXPECT_EQ(names.front(), "initial_loading");
  EXPECT_EQ(names[6], "peak");
  EXPECT_EQ(names[14], "post_peak");
  EXPECT_EQ(names.back(), "steady_state");
  // Where the volume still changes it is no steady state.
  for (std::size_t i = 0; i < strain.size(); ++i) curves.volume[i] = -0.2 * strain[i];
  EXPECT_EQ(NameSegments(path, curves).back(), "post_peak");
}

// An unloading on the way up hides neither the peak nor what comes after it.
TEST(ControlPath, NamesThePeakBehindAReloading) {
  const ControlPath path =
      CleanControl({0, 0.01, 0.02, 0.01, 0.015, 0.02, 0.03, 0.04, 0.08, 0.12}, 0, 1e-4);
  EXPECT_THAT(NameSegments(path, {.strength = {0, 0.4, 0.9, 0.2, 0.6, 0.9, 1.2, 1.4, 1.2, 1.0}}),
              ElementsAre("initial_loading", "initial_loading", "pre_peak", "unload_1", "reload_1",
                          "reload_1", "pre_peak", "peak", "post_peak", "post_peak"));
  // Without a peak the stages are those of the path.
  EXPECT_THAT(NameSegments(path, {.strength = {0, 0.4, 0.9, 0.2, 0.6, 0.9, 1.2, 1.4, 1.6, 1.7}}),
              ElementsAre("initial_loading", "initial_loading", "initial_loading", "unload_1",
                          "reload_1", "reload_1", "reload_1", "reload_1", "reload_1", "reload_1"));
}

TEST(ControlPath, NamesTheSteadyStateBeforeAnUnloading) {
  std::vector<double> strain;
  StageCurves curves;
  for (int i = 0; i <= 40; ++i) {
    strain.push_back(0.005 * i);
    curves.strength.push_back(1 - std::exp(-60 * strain.back()));
  }
  for (int i = 1; i <= 4; ++i) {
    strain.push_back(0.2 - 0.005 * i);
    curves.strength.push_back(1 - 0.3 * i);
  }
  const auto names = NameSegments(CleanControl(strain, 0, 1e-6), curves);
  EXPECT_EQ(names[40], "steady_state");
  EXPECT_EQ(names[41], "unload_1");
  EXPECT_EQ(names.back(), "unload_1");
}

TEST(ControlPath, OneReadingAndNone) {
  EXPECT_THAT(CleanControl({}, 0, std::nullopt).points, IsEmpty());
  EXPECT_THAT(Targets(CleanControl({0.01}, 0, std::nullopt)), ElementsAre(0.01));
}

}  // namespace
}  // namespace calib::campaign
