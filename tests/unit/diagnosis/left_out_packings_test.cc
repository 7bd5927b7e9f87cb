#include "server/diagnosis/left_out_packings.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <set>
#include <utility>

namespace calib::diagnosis {
namespace {

campaign::Campaign WithPackings(const std::vector<std::size_t>& packings) {
  campaign::Campaign campaign;
  for (const std::size_t count : packings) {
    campaign::Experiment& experiment = campaign.experiments.emplace_back();
    experiment.role = campaign::Role::kCalibrate;
    experiment.specimens.resize(count);
  }
  return campaign;
}

// A packing that is on both sides would let a draw be judged by runs on it.
TEST(PackingsApart, NoPackingOfAnyExperimentIsInTwoGroups) {
  const std::vector<std::vector<std::size_t>> cases = {{8, 8}, {4, 8}, {4, 6}, {5, 8}, {6, 9, 1}};
  for (const std::vector<std::size_t>& packings : cases) {
    const int groups = PackingsApart(WithPackings(packings));
    for (const std::size_t count : packings) {
      if (count < 2) continue;
      std::set<std::pair<std::size_t, int>> seen;
      for (int stream = 0; stream < 400; ++stream) {
        seen.emplace(static_cast<std::size_t>(stream) % count, stream % groups);
      }
      EXPECT_EQ(seen.size(), count) << packings.front() << " packings and others";
    }
  }
  EXPECT_EQ(PackingsApart(WithPackings({8, 8})), 8);
  EXPECT_EQ(PackingsApart(WithPackings({4, 8})), 4);
  EXPECT_EQ(PackingsApart(WithPackings({4, 6})), 2);
  EXPECT_EQ(PackingsApart(WithPackings({1})), 1);
}

TEST(PackingsApart, HeldOutExperimentsDoNotCount) {
  campaign::Campaign campaign = WithPackings({8, 3});
  campaign.experiments[1].role = campaign::Role::kValidate;
  EXPECT_EQ(PackingsApart(campaign), 8);
}

// One test on some packings, read along a path with one error; a run on each packing that departs
// more and more from the mean over them.
struct Scattered {
  explicit Scattered(std::size_t packings) : campaign(WithPackings({packings})) {
    campaign::Experiment& experiment = campaign.experiments[0];
    experiment.control = {0.01, 0.02, 0.03, 0.04, 0.05, 0.06};
    experiment.segment.assign(6, "initial_loading");
    experiment.observables.push_back({.name = "stress_ratio",
                                      .values = std::vector<double>(6, 1.0),
                                      .sd = std::vector<double>(6, kSd)});
    for (int k = 0; k < 6; ++k) {
      experiment.path.push_back(
          {.target = experiment.control[static_cast<std::size_t>(k)], .load_step = k});
    }
    readings.of_mean = readings.of_run = campaign::MakeDataSet(campaign);
    readings.departures.resize(static_cast<Eigen::Index>(packings), 6);
    for (int r = 0; r < static_cast<int>(packings); ++r) {
      readings.departure_stream.push_back(r);
      for (int k = 0; k < 6; ++k)
        readings.departures(r, k) = kSd * (k + 1) * std::sin(1 + 2 * r + k);
    }
    readings.measured = true;
  }
  static constexpr double kSd = 0.05;
  campaign::Campaign campaign;
  report::ScatteredReadings readings{};
};

TEST(ClosedFormsWithout, KnowNothingOfThePackingThatIsLeftOut) {
  Scattered one(4);
  const auto before = ClosedFormsWithout(one.campaign, one.readings);
  ASSERT_EQ(before.size(), 4U);
  one.readings.departures.row(2) *= 3;
  const auto after = ClosedFormsWithout(one.campaign, one.readings);
  for (std::size_t left_out = 0; left_out < 4; ++left_out) {
    ASSERT_TRUE(before[left_out] && after[left_out]);
    if (left_out == 2) {
      EXPECT_EQ(*after[left_out], *before[left_out]);
    } else {
      EXPECT_GT(after[left_out]->trace(), 1.5 * before[left_out]->trace());
    }
  }
}

TEST(ClosedFormsWithout, TakeTwinsOnOnePackingLikePackings) {
  Scattered packings(4), twins(1);
  twins.readings.twins = packings.readings.departures;
  twins.readings.departures.resize(0, 6);
  twins.readings.departure_stream.clear();
  const auto expected = ClosedFormsWithout(packings.campaign, packings.readings);
  const auto forms = ClosedFormsWithout(twins.campaign, twins.readings);
  ASSERT_EQ(forms.size(), 4U);
  for (std::size_t left_out = 0; left_out < 4; ++left_out) {
    ASSERT_TRUE(forms[left_out].has_value());
    EXPECT_EQ(*forms[left_out], *expected[left_out]);
  }
}

TEST(ClosedFormsWithout, AreInTheErrorsOfTheReadings) {
  Scattered one(4);
  const auto forms = ClosedFormsWithout(one.campaign, one.readings);
  for (inference::Reading& reading : one.readings.of_mean.readings) reading.sd *= 2;
  const auto halved = ClosedFormsWithout(one.campaign, one.readings);
  EXPECT_NEAR((4 * *halved[1] - *forms[1]).norm(), 0, 1e-12 * forms[1]->norm());
  const Eigen::MatrixXd& covariance = *forms[1];
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(covariance).eigenvalues().minCoeff(), 0);
}

TEST(ClosedFormsWithout, NeedTwoPackingsThatRemain) {
  EXPECT_TRUE(ClosedFormsWithout(Scattered(1).campaign, Scattered(1).readings).empty());
  const Scattered two(2);
  for (const auto& form : ClosedFormsWithout(two.campaign, two.readings)) EXPECT_FALSE(form);
  Scattered not_measured(4);
  not_measured.readings.measured = false;
  EXPECT_TRUE(ClosedFormsWithout(not_measured.campaign, not_measured.readings).empty());
}

}  // namespace
}  // namespace calib::diagnosis
