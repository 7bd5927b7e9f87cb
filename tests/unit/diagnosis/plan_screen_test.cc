#include "server/diagnosis/plan_screen.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::diagnosis {
namespace {

constexpr double kScatter = 5;  // of a single run, in units of the noise
constexpr int kReadings = 28;

// Two runs of one model: half of the variance of each shifts the curve.
std::vector<Eigen::VectorXd> TwoRunsOfOneModel(std::uint64_t seed) {
  inference::PhiloxStream stream(
      {.seed = seed, .purpose = inference::StreamPurpose::kTest, .iteration = 0, .sample = 0});
  std::vector<Eigen::VectorXd> curves;
  for (int curve = 0; curve < 2; ++curve) {
    const double shift = kScatter * stream.Normal();  // sqrt(2 / 2) times
    Eigen::VectorXd& u = curves.emplace_back(kReadings);
    for (double& reading : u) reading = shift + kScatter * stream.Normal();
  }
  return curves;
}

TEST(NextExperiment, RunsOfOneModelAreNotApart) {
  constexpr int kPairs = 200;
  double mean = 0;
  int apart = 0;
  for (std::uint64_t seed = 1; seed <= kPairs; ++seed) {
    const double separation = SeparationOf(TwoRunsOfOneModel(seed), kScatter);
    mean += separation / kPairs;
    apart += separation > 36 ? 1 : 0;
  }
  EXPECT_LT(mean, 5);
  EXPECT_LE(apart, 2);
}

TEST(NextExperiment, WhatIsFarApartIsInUnitsOfTheErrors) {
  const std::vector<Eigen::VectorXd> tenth = {Eigen::VectorXd::Constant(9, 0.1)};
  EXPECT_NEAR(SeparationOf(tenth, 0), 0.09, 1e-12);  // noise alone
  // A shift that a misfit of unknown cause makes too, of sd 0.2: over 1 + 9 x 0.04.
  EXPECT_NEAR(SeparationOf(tenth, 0, {0.2}), 0.09 / 1.36, 1e-12);
  // Of another shape than it, as if there were none.
  const std::vector<Eigen::VectorXd> turning = {Eigen::Vector2d(0.3, -0.3)};
  EXPECT_NEAR(SeparationOf(turning, 0, {5}), 0.18, 1e-12);
  Eigen::VectorXd bump = Eigen::VectorXd::Zero(kReadings);
  bump[3] = 200;
  bump[4] = -200;
  // 80 000 over 1 + 1.5 s^2, less the mean of chance.
  EXPECT_NEAR(SeparationOf({bump}, kScatter), 80000 / 38.5, 20);
}

const std::vector<RivalPair> kOneIsApart = {
    {"a", "b", 0, 0.01}, {"a", "c", 6, 0.99}, {"b", "c", 5, 0.98}};

TEST(NextExperiment, PairsThatStayTogetherAreSaid) {
  PlannedExperiment planned;
  Weigh(kOneIsApart, planned);
  EXPECT_EQ(planned.distance, 5);
  EXPECT_EQ(planned.expected_power, 0.98);
  ASSERT_EQ(planned.together.size(), 1U);
  EXPECT_EQ(planned.together.front(), (std::pair<std::string, std::string>("a", "b")));
}

TEST(NextExperiment, WhereNoneIsToldApartTheBestOfThemCounts) {
  PlannedExperiment planned;
  Weigh({{"a", "b", 0, 0.01}, {"a", "c", 0.5, 0.03}}, planned);
  EXPECT_EQ(planned.distance, 0.5);
  EXPECT_EQ(planned.together.size(), 2U);
}

TEST(NextExperiment, ATestThatTellsOneFromTheOthersIsWorthMoreThanOneThatTellsNothing) {
  EXPECT_GT(ShareToldApart(kOneIsApart),
            ShareToldApart({{"a", "b", 1, 0.09}, {"a", "c", 1, 0.09}, {"b", "c", 1, 0.09}}));
}

}  // namespace
}  // namespace calib::diagnosis
