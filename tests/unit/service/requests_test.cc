#include "server/service/requests.h"

#include <gtest/gtest.h>

#include "server/store/store.h"
#include "tests/support/process.h"

namespace calib::service {
namespace {

TEST(Requests, FirstAnswerIsGivenAgainAndOtherContentRefused) {
  const std::string folder = testing::FreshFolder("requests");
  auto store = *store::Store::Open(folder + "/calib.db");
  Requests requests;
  const auto begin = [&](const std::string& id, const std::string& digest) {
    auto reader = store->Read();
    return requests.Begin(id, digest, *reader);
  };
  EXPECT_FALSE(begin("r", "content")->has_value());
  EXPECT_EQ(begin("r", "content").status().code(), absl::StatusCode::kUnavailable)
      << "still in progress";
  ASSERT_TRUE(store
                  ->WriteNow([](store::Transaction& t) {
                    t.PutRequest("r", {.digest = "content", .answer = "c1"});
                  })
                  .ok());
  requests.Done("r");
  EXPECT_EQ(**begin("r", "content"), "c1");
  EXPECT_EQ(begin("r", "other").status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_FALSE(begin("", "content")->has_value());
  EXPECT_FALSE(begin("", "content")->has_value()) << "without an id every request is new";
}

TEST(Requests, AreRememberedForEachCallerButOperators) {
  const Caller ann{.name = "ann", .role = access::Role::kSubmitter};
  const Caller eve{.name = "eve", .role = access::Role::kSubmitter};
  EXPECT_NE(RequestKey(ann, "r"), RequestKey(eve, "r"));
  EXPECT_NE(RequestKey(ann, "r"), "r");
  EXPECT_EQ(RequestKey({.name = "ops", .role = access::Role::kOperator}, "r"),
            RequestKey({.name = "root", .role = access::Role::kOperator}, "r"));
  EXPECT_EQ(RequestKey(ann, ""), "");
}

}  // namespace
}  // namespace calib::service
