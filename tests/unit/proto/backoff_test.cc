#include "proto/rpc/backoff.h"

#include <gtest/gtest.h>

#include <vector>

#include "proto/rpc/status.h"

namespace calib::rpc {
namespace {

using std::chrono::milliseconds;

TEST(Backoff, WaitsGrowToTheLimitAndStartAgain) {
  Backoff backoff({.first = milliseconds(100), .longest = milliseconds(1000)}, 1);
  milliseconds longest{0};
  for (int i = 0; i < 200; ++i) {
    const milliseconds wait = backoff.Next();
    EXPECT_GE(wait.count(), 1);
    EXPECT_LE(wait.count(), 1000);
    longest = std::max(longest, wait);
  }
  EXPECT_GT(longest.count(), 800);
  backoff.Reset();
  EXPECT_LE(backoff.Next().count(), 100);
}

TEST(Status, CodesAndMessagesSurviveTheWire) {
  for (int code = 1; code <= 16; ++code) {
    const absl::Status status(static_cast<absl::StatusCode>(code), "why");
    EXPECT_EQ(FromGrpc(ToGrpc(status)), status);
  }
  EXPECT_TRUE(FromGrpc(ToGrpc(absl::OkStatus())).ok());
}

}  // namespace
}  // namespace calib::rpc
