#include "server/service/upkeep/metrics.h"

#include <gmock/gmock.h>

#include <chrono>
#include <string>

namespace calib::service {
namespace {

using ::testing::HasSubstr;

TEST(Metrics, BucketsAreCumulativeAndEndWithAll) {
  store::Durations took;
  took.Add(std::chrono::microseconds(500));
  took.Add(std::chrono::milliseconds(40));
  took.Add(std::chrono::seconds(60));
  const std::string text = MetricsText({.acknowledgements = took.Read()});
  EXPECT_THAT(text, HasSubstr("# TYPE calib_ack_seconds histogram\n"
                              "calib_ack_seconds_bucket{le=\"0.001\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("calib_ack_seconds_bucket{le=\"0.025\"} 1\n"
                              "calib_ack_seconds_bucket{le=\"0.05\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("calib_ack_seconds_bucket{le=\"10\"} 2\n"
                              "calib_ack_seconds_bucket{le=\"+Inf\"} 3\n"
                              "calib_ack_seconds_sum 60.0405\n"
                              "calib_ack_seconds_count 3\n"));
}

TEST(Metrics, ABoundIsWithinItsOwnBucket) {
  store::Durations took;
  took.Add(std::chrono::milliseconds(1));
  EXPECT_EQ(took.Read().within[0], 1U);
}

TEST(Metrics, EveryEndHasALineAndExpiredLeasesAreTheLostOnes) {
  Measured measured{.engine = "a \"b\"\n", .slots = 5, .busy = 2, .held = {{"ann", 2}}};
  measured.store.written.ended[static_cast<std::size_t>(store::AttemptOutcome::kLost)] = 7;
  measured.store.written.ended[static_cast<std::size_t>(store::AttemptOutcome::kCancelled)] = 3;
  const std::string text = MetricsText(measured);
  for (const char* line :
       {"calib_build_info{engine=\"a \\\"b\\\" \"} 1\n", "calib_runs_total{end=\"completed\"} 0\n",
        "calib_runs_total{end=\"lost\"} 7\n", "calib_runs_total{end=\"cancelled\"} 3\n",
        "calib_lease_expiries_total 7\n", "calib_slots{state=\"busy\"} 2\n",
        "calib_slots{state=\"free\"} 3\n", "calib_slots_held{owner=\"ann\"} 2\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
}

}  // namespace
}  // namespace calib::service
