#include "server/ctl/left_out_packings.h"

#include <gtest/gtest.h>

#include <set>
#include <utility>

namespace calib::ctl {
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

}  // namespace
}  // namespace calib::ctl
