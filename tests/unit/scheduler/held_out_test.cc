#include <gtest/gtest.h>

#include <cmath>

#include "server/planning/requests.h"

namespace calib::scheduler {
namespace {

std::vector<double> Logs(const std::vector<double>& weights) {
  std::vector<double> logs;
  for (const double w : weights) logs.push_back(std::log(w));
  return logs;
}

TEST(HeldOut, TheHeaviestUpToTheirShareOfTheWeight) {
  EXPECT_EQ(planning::Heaviest(Logs({0.004, 0.5, 0.496})), (std::vector<std::size_t>{1, 2}));
  EXPECT_EQ(planning::Heaviest(Logs({0.25, 0.5, 0.25})), (std::vector<std::size_t>{1, 0, 2}))
      << "ties: the earlier one";
  EXPECT_EQ(planning::Heaviest(std::vector<double>(100, std::log(0.01))).size(),
            planning::kHeldOutRuns);
  EXPECT_TRUE(planning::Heaviest({}).empty());
}

TEST(HeldOut, EvenSharesOfTheWeightFallOnSamples) {
  // Twenty shares: a sample with two of them is run once, one with half of one every other time.
  std::vector<double> weights(40, 0.5 / 20);
  EXPECT_EQ(planning::EvenlyByWeight(Logs(weights)).size(), planning::kHeldOutRuns);
  EXPECT_EQ(planning::EvenlyByWeight(Logs({0.1, 0.8, 0.1})), (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_EQ(planning::EvenlyByWeight(Logs({0.001, 0.998, 0.001})), (std::vector<std::size_t>{1}));
}

TEST(HeldOut, DrawsEvenlySpacedInTheirOrder) {
  const Eigen::MatrixXd draws = Eigen::VectorXd::LinSpaced(1000, 0, 999);
  const Eigen::MatrixXd rows = planning::EvenlySpaced(draws, 100);
  ASSERT_EQ(rows.rows(), static_cast<Eigen::Index>(planning::kHeldOutRuns));
  EXPECT_EQ(rows(1, 0), 50);
  EXPECT_EQ(planning::EvenlySpaced(draws, 4)(3, 0), 750);
  EXPECT_EQ(planning::EvenlySpaced(draws.topRows(3), 100), draws.topRows(3));
}

}  // namespace
}  // namespace calib::scheduler
