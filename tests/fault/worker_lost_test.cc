// Workers killed, frozen past their lease and woken.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>
#include <vector>

#include "tests/fault/undisturbed.h"
#include "tests/support/sixty_four_grains.h"

namespace calib::testing {
namespace {

void Submit(const Deployment& deployment) {
  Client client = deployment.client();
  const SmallCampaign campaign = FaultCampaign();
  const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
  ASSERT_TRUE(id.ok()) << id.status();
}

bool HasCome(Client& client, const std::string& worker) {
  return Eventually(kLong, [&] {
    const auto workers = client.Workers();
    return workers.ok() && std::any_of(workers->workers().begin(), workers->workers().end(),
                                       [&](const auto& w) { return w.name() == worker; });
  });
}

TEST(WorkerLost, KilledTenTimesAtRandomMoments) {
  Deployment deployment({.name = "killed-worker", .lease_ms = 500});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Submit(deployment);
  deployment.StartWorker();
  std::mt19937 random(20260102);
  std::uniform_int_distribution<int> moment(0, 150);
  Client client = deployment.client();
  for (int i = 0; i < 10; ++i) {
    deployment.StartWorker();
    const std::string name = "w" + std::to_string(i + 2);
    ASSERT_TRUE(HasCome(client, name)) << deployment.Logs();
    std::this_thread::sleep_for(std::chrono::milliseconds(moment(random)));
    deployment.workers().back().Kill();
  }
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
}

// Their last words and their ends come in together once the server goes on.
TEST(WorkerLost, AllAtOnceWhileTheServerIsFrozen) {
  constexpr int kWorkers = 4;
  Deployment deployment({.name = "frozen-server", .heartbeat_ms = 10});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Client client = deployment.client();
  for (int round = 0; round < 10; ++round) {
    for (int i = 0; i < kWorkers; ++i) deployment.StartWorker();
    ASSERT_TRUE(Eventually(kLong, [&] {
      const auto workers = client.Workers();
      return workers.ok() && std::count_if(workers->workers().begin(), workers->workers().end(),
                                           [](const auto& w) { return w.connected(); }) == kWorkers;
    })) << deployment.Logs();
    deployment.server().Signal(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    for (int i = 0; i < kWorkers; ++i) {
      deployment.workers().back().Kill();
      deployment.workers().pop_back();
    }
    deployment.server().Signal(SIGCONT);
    ASSERT_TRUE(Eventually(
        kLong,
        [&] {
          const auto workers = client.Workers();
          return workers.ok() && std::none_of(workers->workers().begin(), workers->workers().end(),
                                              [](const auto& w) { return w.connected(); });
        }))
        << "round " << round << "\n"
        << deployment.Logs();
  }
}

/// A line of the only worker's log holds this.
bool HasLogged(const Deployment& deployment, const std::string& text) {
  return deployment.Logs().find(text) != std::string::npos;
}

TEST(WorkerLost, ToldToLeaveItEndsWhatItRuns) {
  Deployment deployment({.name = "told-to-leave"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Submit(deployment);
  deployment.StartWorker(2, {"--drain-within", "100"});
  ASSERT_TRUE(Eventually(kLong, [&] { return HasLogged(deployment, "start attempt="); }));
  Process& worker = deployment.workers().back();
  worker.Signal(SIGTERM);
  EXPECT_EQ(worker.Wait(kLong), 0) << deployment.Logs();
  EXPECT_TRUE(HasLogged(deployment, "draining running=")) << deployment.Logs();
  EXPECT_TRUE(HasLogged(deployment, " drained")) << deployment.Logs();
  EXPECT_FALSE(HasLogged(deployment, "outcome=OUTCOME_STOPPED")) << deployment.Logs();
  const auto evaluations = deployment.client().Show("c1");
  ASSERT_TRUE(evaluations.ok()) << evaluations.status();
  EXPECT_GE(evaluations->model_evaluations(), 1) << "what ran has counted";
  deployment.StartWorker(2);
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
}

TEST(WorkerLost, ToldToLeaveTwiceOrForTooLongItStopsWhatItRuns) {
  for (const bool twice : {true, false}) {
    Deployment deployment({.name = "told-to-leave-twice"});
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
    Client client = deployment.client();
    // Each run takes hours.
    std::string yaml = SixtyFourGrains("{q_over_p: {noise: {absolute: 0.3}}}", 4, 1);
    const std::string fast = "rate: 1 1/s";
    ASSERT_NE(yaml.find(fast), std::string::npos) << yaml;
    yaml.replace(yaml.find(fast), fast.size(), "rate: 0.0001 1/s");
    const auto id = client.SubmitCampaign(
        yaml, {{"data.csv", "axial_strain,q_over_p\n0.002,0.5\n0.005,0.8\n0.01,1.0\n"}}, "r");
    ASSERT_TRUE(id.ok()) << id.status();
    deployment.StartWorker(1, {"--drain-within", twice ? "1000" : "1"});
    ASSERT_TRUE(Eventually(kLong, [&] { return HasLogged(deployment, "start attempt="); }));
    Process& worker = deployment.workers().back();
    worker.Signal(SIGTERM);
    ASSERT_TRUE(Eventually(kLong, [&] { return HasLogged(deployment, "draining running="); }));
    if (twice) worker.Signal(SIGTERM);
    EXPECT_EQ(worker.Wait(kLong), 0) << deployment.Logs();
    EXPECT_TRUE(HasLogged(deployment, "outcome=OUTCOME_STOPPED")) << deployment.Logs();
  }
}

// Nobody hears it then; it leaves all the same.
TEST(WorkerLost, ToldToLeaveWhileTheServerIsAway) {
  Deployment deployment({.name = "told-alone"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(1, {"--drain-within", "1000"});
  ASSERT_TRUE(Eventually(kLong, [&] { return HasLogged(deployment, "connected server="); }));
  deployment.server().Kill();
  ASSERT_TRUE(Eventually(kLong, [&] { return HasLogged(deployment, "disconnected server="); }));
  Process& worker = deployment.workers().back();
  worker.Signal(SIGTERM);
  EXPECT_EQ(worker.Wait(kLong), 0) << deployment.Logs();
}

TEST(WorkerLost, FrozenPastItsLeaseAndWoken) {
  Deployment deployment({.name = "frozen", .lease_ms = 300, .heartbeat_ms = 50});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Submit(deployment);
  deployment.StartWorker(2);
  Client client = deployment.client();
  for (int i = 0; i < 3; ++i) {
    // Freeze it while it holds something, until the server has given that up.
    ASSERT_TRUE(Eventually(kLong, [&] {
      const auto workers = client.Workers();
      return workers.ok() && workers->workers_size() == 1 && workers->workers(0).busy() == 2;
    })) << deployment.Logs();
    deployment.workers()[0].Signal(SIGSTOP);
    const auto given_up = [&] {
      const auto workers = client.Workers();
      return workers.ok() && workers->workers(0).busy() == 0;
    };
    ASSERT_TRUE(Eventually(kLong, given_up)) << deployment.Logs();
    deployment.workers()[0].Signal(SIGCONT);
  }
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
  std::size_t lost = 0;
  const auto log = client.Log("c1");
  ASSERT_TRUE(log.ok()) << log.status();
  for (const v1::LogEntry& entry : *log) {
    lost += entry.what().find("nothing was heard") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(lost, 3U) << "the freezes must have been noticed";
}

/// Children of a process.
std::vector<pid_t> ChildrenOf(pid_t parent) {
  std::vector<pid_t> children;
  std::error_code gone;
  for (const auto& thread :
       std::filesystem::directory_iterator("/proc/" + std::to_string(parent) + "/task", gone)) {
    std::ifstream file(thread.path() / "children");
    for (pid_t child = 0; file >> child;) children.push_back(child);
  }
  return children;
}

// An engine that dies takes its own run along and nothing else: the worker stays connected, two
// people's campaigns go on, to the bits of an undisturbed run.
TEST(WorkerLost, ItsEnginesKilledBesideAnothersCampaign) {
  Deployment deployment({.name = "killed-engine"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Submit(deployment);
  Client client = deployment.client();
  const SmallCampaign other = MakeSmallCampaign({.samples = 16, .load_steps = 6});
  ASSERT_TRUE(client.SubmitCampaign(other.yaml, other.files, "other").ok());
  deployment.StartWorker(2);
  std::mt19937 random(20261130);
  std::uniform_int_distribution<int> moment(0, 60);
  constexpr std::array kSignals{SIGSEGV, SIGABRT, SIGKILL};
  int killed = 0;
  for (int i = 0; i < 200 && killed < 12; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(moment(random)));
    const std::vector<pid_t> engines = ChildrenOf(deployment.workers().back().id());
    if (engines.empty()) continue;
    kill(engines[static_cast<std::size_t>(i) % engines.size()],
         kSignals[static_cast<std::size_t>(i) % kSignals.size()]);
    ++killed;
  }
  EXPECT_EQ(killed, 12);
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
  ASSERT_TRUE(client.Watch("c2", kLong).ok());
  const auto status = client.Show("c2");
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_EQ(status->state(), "finished") << status->reason();
  const auto workers = client.Workers();
  ASSERT_TRUE(workers.ok()) << workers.status();
  EXPECT_TRUE(workers->workers_size() == 1 && workers->workers(0).connected());
}

// Those told to leave leave checkpoints, from which others go on: to the same bits.
TEST(WorkerLost, ToldToLeaveTheyLeaveCheckpoints) {
  Deployment deployment({.name = "leaving"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Submit(deployment);
  Client client = deployment.client();
  std::mt19937 random(20261201);
  std::uniform_int_distribution<int> moment(20, 150);
  for (int i = 0; i < 8; ++i) {
    deployment.StartWorker(2);
    Process& worker = deployment.workers().back();
    const std::string name = "w" + std::to_string(i + 1);
    ASSERT_TRUE(HasCome(client, name)) << deployment.Logs();
    std::this_thread::sleep_for(std::chrono::milliseconds(moment(random)));
    if (i % 2 == 0) {
      worker.Signal(SIGTERM);
    } else {
      ASSERT_TRUE(client.Drain(name, std::chrono::milliseconds(1)).ok());
    }
    EXPECT_EQ(worker.Wait(kLong), 0) << deployment.Logs();
  }
  deployment.StartWorker(2);
  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
}

/// So little may be lost that every sample goes on from its rungs: the result is that of runs which
/// go to their ends at once.
SmallCampaign BreadthFirst(const std::string& rungs) {
  return MakeSmallCampaign({.samples = 16,
                            .max_iterations = 1,
                            .load_steps = 6,
                            .failure_attempts = 100,
                            .relative_noise = 0.3,
                            .method = "sqmc",
                            .extra = "early_stopping: {discard_at_most: 1e-300" + rungs + "}\n"});
}

TEST(WorkerLost, KilledWhileItsSamplesRest) {
  const auto submit = [](Client& client, const std::string& rungs) {
    const SmallCampaign campaign = BreadthFirst(rungs);
    const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
    ASSERT_TRUE(id.ok()) << id.status();
  };
  Deployment depth({.name = "depth-first"});
  ASSERT_TRUE(depth.StartServer()) << depth.Logs();
  depth.StartWorker(2);
  Client depth_client = depth.client();
  submit(depth_client, "");
  ASSERT_TRUE(WaitFinished(depth)) << depth.Logs();
  const auto expected = Fingerprint(depth_client, "c1");
  ASSERT_TRUE(expected.ok()) << expected.status();

  Deployment breadth({.name = "breadth-first", .lease_ms = 500});
  ASSERT_TRUE(breadth.StartServer()) << breadth.Logs();
  Client client = breadth.client();
  submit(client, ", rungs: [0.3, 0.7]");
  const auto resting = [&](int count) {
    return Eventually(kLong, [&, count] {
      const auto status = client.Show("c1");
      return status.ok() && (status->samples_resting() >= count || status->state() == "finished");
    });
  };
  // The first worker holds samples that rest and is gone for good; so is the server, for a moment.
  breadth.StartWorker(1);
  ASSERT_TRUE(resting(5)) << breadth.Logs();
  breadth.workers()[0].Kill();
  breadth.StartWorker(1);
  ASSERT_TRUE(resting(10)) << breadth.Logs();
  breadth.server().Kill();
  ASSERT_TRUE(breadth.StartServer()) << breadth.Logs();
  ASSERT_TRUE(WaitFinished(breadth)) << breadth.Logs();
  const auto found = Fingerprint(client, "c1");
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_TRUE(*found == *expected) << "other bits than depth first";
  const auto log = client.Log("c1");
  ASSERT_TRUE(log.ok()) << log.status();
  for (const v1::LogEntry& entry : *log) {
    EXPECT_EQ(entry.what().find("nondeterminism"), std::string::npos) << entry.what();
  }
}

}  // namespace
}  // namespace calib::testing
