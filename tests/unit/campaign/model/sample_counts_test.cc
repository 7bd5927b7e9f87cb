#include "server/campaign/model/sample_counts.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace calib::campaign {
namespace {

using enum EvaluationStatus;

SampleStatus SampleOf(const std::vector<std::pair<EvaluationStatus, bool>>& evaluations) {
  SampleStatus status;
  for (const auto& [evaluation, rests] : evaluations) status.Add(evaluation, rests);
  return status;
}

TEST(SampleStatus, IsTheFirstThatEndedWithoutAResultElseHowFarItHasCome) {
  EXPECT_EQ(SampleOf({{kWaiting, false}, {kWaiting, false}}).worst(), kWaiting);
  EXPECT_EQ(SampleOf({{kWaiting, false}, {kRunning, false}}).worst(), kRunning);
  EXPECT_EQ(SampleOf({{kFinished, false}, {kWaiting, false}}).worst(), kRunning);
  EXPECT_EQ(SampleOf({{kFinished, false}, {kFinished, false}}).worst(), kFinished);
  EXPECT_EQ(SampleOf({{kFinished, false}, {kUnknown, false}, {kDiverged, false}}).worst(),
            kUnknown);
  const SampleStatus resting = SampleOf({{kStoppedEarly, true}, {kDiverged, false}});
  EXPECT_EQ(resting.worst(), kStoppedEarly);
  EXPECT_TRUE(resting.at_rung());
  EXPECT_FALSE(SampleOf({{kStoppedEarly, false}}).at_rung());
  EXPECT_FALSE(SampleOf({{kFailed, true}}).at_rung());
}

TEST(SampleStatus, TellsWhatItHasEndedBy) {
  SampleStatus status;
  EXPECT_FALSE(status.Add(kFinished, false));
  EXPECT_TRUE(status.Add(kDiverged, false));
  EXPECT_FALSE(status.Add(kUnknown, false));
}

TEST(SampleCounts, CountEachSampleOnceAndTakeItOutAgain) {
  const std::vector<SampleStatus> samples = {
      SampleOf({{kWaiting, false}}),     SampleOf({{kRunning, false}}),
      SampleOf({{kFinished, false}}),    SampleOf({{kDiverged, false}}),
      SampleOf({{kUnknown, false}}),     SampleOf({{kStoppedEarly, false}}),
      SampleOf({{kStoppedEarly, true}}), SampleOf({{kFailed, false}})};
  SampleCounts counts;
  for (const SampleStatus& sample : samples) counts.Add(sample);
  EXPECT_EQ(counts, (SampleCounts{.samples = 8,
                                  .running = 1,
                                  .finished = 1,
                                  .diverged = 1,
                                  .unknown = 1,
                                  .stopped = 1,
                                  .at_rung = 1}));
  for (const SampleStatus& sample : samples) counts.Add(sample, -1);
  EXPECT_EQ(counts, SampleCounts{});
}

}  // namespace
}  // namespace calib::campaign
