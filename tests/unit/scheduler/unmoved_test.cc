#include "server/planning/unmoved.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/square_campaign.h"

namespace calib::scheduler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// A lattice of golden ratios in the unit square; predictions are 1 + slopes times a and b.
inference::Iteration Runs(Eigen::Index count, double slope_a, double slope_b) {
  inference::Iteration iteration;
  iteration.parameters.resize(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    iteration.parameters(i, 0) = std::fmod(0.5 + 0.754877666 * static_cast<double>(i), 1);
    iteration.parameters(i, 1) = std::fmod(0.5 + 0.569840291 * static_cast<double>(i), 1);
  }
  iteration.predictions.resize(count, 2);
  iteration.predictions.col(0) = 1 + slope_a * (iteration.parameters.col(0).array() - 0.5);
  iteration.predictions.col(1) = 1 + slope_b * (iteration.parameters.col(1).array() - 0.5);
  return iteration;
}

// Readings have an sd of 0.1, a tenth of which is what counts.
TEST(Unmoved, AnObservableThatNoRunChangesIsNamed) {
  const auto definition = planning::MakeDefinition(testing::SquareCampaign());
  const inference::Iteration still = Runs(30, 0, 0.005);
  EXPECT_THAT(planning::UnmovedReadings(*definition, {&still, 1}),
              ElementsAre(HasSubstr("tx, q_over_p: is the same in all 30 runs")));
  const inference::Iteration moved = Runs(30, 0, 0.05);
  EXPECT_THAT(planning::UnmovedReadings(*definition, {&moved, 1}), IsEmpty());
  const inference::Iteration alone = Runs(1, 0, 0);
  EXPECT_THAT(planning::UnmovedReadings(*definition, {&alone, 1}), IsEmpty());
  inference::Iteration diverged = Runs(30, 0, 0.05);  // what is left is one run
  diverged.predictions.bottomRows(29).setConstant(std::nan(""));
  EXPECT_THAT(planning::UnmovedReadings(*definition, {&diverged, 1}), IsEmpty());
}

TEST(Unmoved, AParameterWhosePosteriorIsItsPriorIsNamed) {
  const auto definition = planning::MakeDefinition(testing::SquareCampaign());
  const auto said = [&definition](double slope_a, double slope_b) {
    const inference::Iteration runs = Runs(400, slope_a, slope_b);
    const auto answer = planning::FindAnswer(*definition, {&runs, 1});
    EXPECT_TRUE(answer.ok() && answer->HasIntervals()) << answer.status();
    return planning::UnmovedParameters(*definition, *answer);
  };
  EXPECT_THAT(said(0, 0), HasSubstr("The posterior is the prior"));
  EXPECT_THAT(said(0.5, 0), HasSubstr("The posterior of b is its prior"));
  EXPECT_EQ(said(0.5, 0.5), "");
}

}  // namespace
}  // namespace calib::scheduler
