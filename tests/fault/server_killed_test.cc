// kill -9 of the server, at random moments and at its commits.
#include <gtest/gtest.h>

#include <csignal>
#include <random>
#include <thread>

#include "tests/fault/undisturbed.h"

namespace calib::testing {
namespace {

TEST(ServerKilled, TenTimesAtRandomMoments) {
  Deployment deployment({.name = "killed-server"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker();
  deployment.StartWorker();
  {
    Client client = deployment.client();
    const SmallCampaign campaign = FaultCampaign();
    const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
    ASSERT_TRUE(id.ok()) << id.status();
  }
  std::mt19937 random(20260101);
  std::uniform_int_distribution<int> moment(0, 250);
  std::set<std::string> acknowledged;
  for (int i = 0; i < 10; ++i) {
    Client client = deployment.client();
    // A random moment, not a synchronisation: any will do.
    std::this_thread::sleep_for(std::chrono::milliseconds(moment(random)));
    acknowledged.merge(StatesNow(client));
    deployment.server().Kill();
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  }
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
  Client client = deployment.client();
  ExpectContains(StatesNow(client), acknowledged);
}

/// Serves `deployment`'s state by a server that dies at its n-th commit; returns once it is dead or
/// the campaign done.
void ServeUntilCommit(const Deployment& deployment, const std::string& when, int n) {
  Process dying(
      {Program("calibd_dying"), deployment.state(), deployment.address(), when, std::to_string(n)},
      deployment.folder() + "/dying.log");
  Client client = deployment.client();
  ASSERT_TRUE(Eventually(kLong, [&] {
    const auto status = client.Show("c1");
    return !dying.Running() || (status.ok() && status->state() == "finished");
  }));
}

TEST(ServerKilled, AtEveryKindOfCommit) {
  // The commits of a server's life: taking up, leases, states, ends of attempts, plans. Dying at
  // the n-th of each life, n = 1, 2, 3, ... meets them all, and every life begins with what the one
  // before left.
  for (const std::string when : {"before", "after"}) {
    Deployment deployment({.name = "commit-" + when});
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
    {
      Client client = deployment.client();
      const SmallCampaign campaign = FaultCampaign();
      const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
      ASSERT_TRUE(id.ok()) << id.status();
    }
    deployment.server().Kill();
    deployment.StartWorker(2);
    for (int n = 1; n <= 12; ++n) {
      ServeUntilCommit(deployment, when, n);
    }
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
    ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
    ExpectUndisturbed(deployment);
  }
}

}  // namespace
}  // namespace calib::testing
