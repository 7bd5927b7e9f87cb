// A server started again while calibctl asks: the question is asked again.
#include "server/client/client.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <thread>

#include "tests/fault/undisturbed.h"

namespace calib::testing {
namespace {

/// What `ask` says when the server is killed before and started again a moment after it.
template <typename Ask>
auto AcrossARestart(Deployment& deployment, const Ask& ask) {
  deployment.server().Kill();
  auto answer = std::async(std::launch::async, ask);
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  // In this thread: children die with the thread that started them.
  EXPECT_TRUE(deployment.StartServer()) << deployment.Logs();
  return answer.get();
}

TEST(Client, AsksAgainWhenTheServerIsBack) {
  Deployment deployment({.name = "asked-again"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  auto connected = client::Client::Connect(deployment.address());
  ASSERT_TRUE(connected.ok()) << connected.status();
  client::Client& client = **connected;
  ASSERT_TRUE(client.List().ok());
  const auto listed = AcrossARestart(deployment, [&client] { return client.List(); });
  EXPECT_TRUE(listed.ok()) << listed.status();

  const SmallCampaign campaign = FaultCampaign();
  Client submitting = deployment.client();
  const auto id = submitting.SubmitCampaign(campaign.yaml, campaign.files, "r");
  ASSERT_TRUE(id.ok()) << id.status();
  const auto paused = AcrossARestart(deployment, [&client, &id] { return client.Pause(*id); });
  ASSERT_TRUE(paused.ok()) << paused.status();
  EXPECT_EQ(paused->state(), "paused");
}

TEST(Client, DoesNotWaitForAServerThatWasNeverThere) {
  const auto begun = std::chrono::steady_clock::now();
  const auto client = client::Client::Connect("127.0.0.1:9");
  EXPECT_EQ(client.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(client.status().message().find("no server answers at 127.0.0.1:9"), std::string::npos)
      << client.status();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(10));
}

}  // namespace
}  // namespace calib::testing
