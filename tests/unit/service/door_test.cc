#include "server/service/door.h"

#include <gtest/gtest.h>

#include <vector>

#include "calib/v1/campaign.pb.h"

namespace calib::service {
namespace {

TEST(Door, APeerHasSoManyCallsOpenAndOthersTheirOwn) {
  Door door({.streams_per_peer = 2});
  auto first = door.Enter("ipv4:10.0.0.1:1000");
  auto second = door.Enter("ipv4:10.0.0.1:1000");
  ASSERT_TRUE(first.ok() && second.ok());
  const auto third = door.Enter("ipv4:10.0.0.1:1000");
  EXPECT_EQ(third.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(third.status().message().find("--max-streams-per-peer"), std::string::npos);
  EXPECT_TRUE(door.Enter("ipv4:10.0.0.1:1001").ok()) << "another connection";
  first->reset();
  EXPECT_TRUE(door.Enter("ipv4:10.0.0.1:1000").ok()) << "one has ended";
}

TEST(Door, FilesOnTheirWayAreCountedOfEachPeerAndOfAll) {
  Door door({.blobs_per_peer = 1, .blobs = 2});
  std::vector<absl::StatusOr<Door::Pass>> passes;
  passes.push_back(door.EnterWithBlob("a"));
  ASSERT_TRUE(passes.back().ok());
  EXPECT_EQ(door.EnterWithBlob("a").status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(door.Enter("a").ok()) << "a question is none";
  passes.push_back(door.EnterWithBlob("b"));
  ASSERT_TRUE(passes.back().ok());
  EXPECT_NE(door.EnterWithBlob("c").status().message().find("--max-blobs)"), std::string::npos);
  passes.clear();
  EXPECT_TRUE(door.EnterWithBlob("c").ok());
}

TEST(Door, SaysWhichFieldBreaksItsRule) {
  Door door({});
  v1::ControlRequest request;
  request.set_campaign("c1");
  EXPECT_TRUE(door.Check("a", request).ok());
  request.set_request_id(std::string(129, 'x'));
  const absl::Status status = door.Check("a", request);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), "ControlRequest.request_id has 129 bytes, at most 128");
}

}  // namespace
}  // namespace calib::service
