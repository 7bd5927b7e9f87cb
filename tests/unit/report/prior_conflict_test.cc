#include "server/report/views/prior_conflict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/report/views/comparison.h"
#include "server/report/views/residual_words.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// All runs within reach of the readings but for a stretch that is moved away by `sd`.
CampaignView Moved(double sd) {
  CampaignView view = testing::ExampleView("moved");
  campaign::MeasuredObservable& o = view.campaign.experiments[0].observables[0];
  for (std::size_t i = 10; i < 15; ++i) o.values[i] += sd * o.sd[i];
  return view;
}

TEST(PriorConflict, RunsThatSurroundTheReadingsAreNone) {
  EXPECT_THAT(PriorConflicts(Moved(0)), IsEmpty());
}

TEST(PriorConflict, AStretchThatNoRunReachesIsNamed) {
  const CampaignView view = Moved(400);
  const auto conflicts = PriorConflicts(view);
  ASSERT_EQ(conflicts.size(), 1U);
  const campaign::Experiment& e = view.campaign.experiments[0];
  EXPECT_EQ(conflicts[0].experiment, e.name);
  EXPECT_EQ(conflicts[0].readings, 5);
  EXPECT_EQ(conflicts[0].from, e.control[10]);
  EXPECT_EQ(conflicts[0].to, e.control[14]);
  EXPECT_TRUE(conflicts[0].too_low);
  EXPECT_GT(conflicts[0].nearest, 3);
  Comparison comparison = Compare(view, PredictReadings(view));
  comparison.prior_conflicts = conflicts;
  EXPECT_THAT(WhereItFails(comparison)[0], HasSubstr("no parameters of the prior reach the 5 "));
  const auto high = PriorConflicts(Moved(-400));
  ASSERT_EQ(high.size(), 1U);
  EXPECT_FALSE(high[0].too_low);
}

TEST(PriorConflict, NothingIsSaidOfFewRunsOrErrorsOfUnknownSize) {
  CampaignView view = Moved(400);
  view.campaign.filter.noise = inference::NoiseMode::kInferred;
  EXPECT_THAT(PriorConflicts(view), IsEmpty());
  view = Moved(400);
  int kept = 0;
  std::erase_if(view.samples, [&kept](const v1::Sample& s) {
    return s.iteration() == 0 && ++kept >= kLeastRuns;
  });
  EXPECT_THAT(PriorConflicts(view), IsEmpty());
}

}  // namespace
}  // namespace calib::report
