#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using Kind = v1::ServerMessage::MessageCase;
using std::chrono::milliseconds;

testing::SmallCampaign Small() {
  return testing::MakeSmallCampaign({.samples = 6, .max_iterations = 2, .failure_attempts = 100});
}

TEST(CampaignLife, WorkIsHandedOutInOrderAndAcknowledgedAfterItsCommit) {
  SimulatedService service("order");
  EXPECT_EQ(service.Submit(Small()), "c1");
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kQueued);
  const std::int64_t worker = service.Connect("w", 2);
  EXPECT_TRUE(service.Next(worker, Kind::kWelcome).has_welcome());
  const v1::Lease first = service.Next(worker, Kind::kLease).lease();
  const v1::Lease second = service.Next(worker, Kind::kLease).lease();
  EXPECT_LT(first.attempt(), second.attempt());
  EXPECT_FALSE(service.Next(worker, Kind::kLease).has_lease()) << "both slots are busy";
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kRunning);
  service.SendStates(worker, first, 0, 4);
  EXPECT_EQ(service.Next(worker, Kind::kAck).ack().up_to(), 4);
  EXPECT_EQ(service.Read().States(1)->size(), 4U);
  service.SendEnd(worker, first.attempt(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_TRUE(service.Next(worker, Kind::kAck).ack().finished());
  EXPECT_TRUE(service.Next(worker, Kind::kLease).has_lease());
}

TEST(CampaignLife, SilentWorkersAttemptGoesToAnotherAndItsLateWordsAreRefused) {
  SimulatedService service("silent");
  service.Submit(Small());
  const std::int64_t silent = service.Connect("silent", 1);
  const v1::Lease lost = service.Next(silent, Kind::kLease).lease();
  service.Advance(milliseconds(1001));
  const std::int64_t other = service.Connect("other", 1);
  const v1::Lease again = service.Next(other, Kind::kLease).lease();
  EXPECT_GT(again.attempt(), lost.attempt());
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(again.spec(), lost.spec()));
  EXPECT_TRUE(service.Next(silent, Kind::kAck).ack().refused());
  service.SendStates(silent, lost, 0, 1);
  EXPECT_TRUE(service.Next(silent, Kind::kAck).ack().refused());
  EXPECT_TRUE(service.Read().States(1)->empty());
}

TEST(CampaignLife, GatheredStatesOfSeveralRunsAreAcknowledgedTogetherOnceTheyAreOnDisk) {
  SimulatedService service("gathered");
  service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 3);
  EXPECT_GT(service.Next(worker, Kind::kWelcome).welcome().gather_ms(), 0);
  std::vector<v1::Lease> leases;
  for (int k = 0; k < 3; ++k) leases.push_back(service.Next(worker, Kind::kLease).lease());
  v1::StateBatches gathered;
  for (const v1::Lease& lease : leases) {
    *gathered.add_batches() = service.States(lease, 0, 2);
  }
  gathered.mutable_batches(1)->mutable_states(0)->set_load_step(999);  // of no path
  service.scheduler().Receive(worker, gathered);
  EXPECT_FALSE(service.Next(worker, Kind::kAcks).has_acks()) << "nothing is on disk yet";
  service.ports().Run();
  const v1::Acks acks = service.Next(worker, Kind::kAcks).acks();
  ASSERT_EQ(acks.acks_size(), 2) << "the wrong one has failed by itself";
  EXPECT_EQ(acks.acks(0).attempt(), leases[0].attempt());
  EXPECT_EQ(acks.acks(1).attempt(), leases[2].attempt());
  EXPECT_EQ(acks.acks(1).up_to(), 2);
  EXPECT_EQ(service.Read().States(1)->size(), 4U);
}

TEST(CampaignLife, ALargeNodeIsFilledInSeveralTurns) {
  constexpr int kSlots = 200;
  SimulatedService service("large_node");
  service.Submit(testing::MakeSmallCampaign({.samples = kSlots, .max_iterations = 2}));
  v1::Hello hello = testing::MatchingHello("large", kSlots);
  ASSERT_TRUE(service.scheduler().Connected(1, hello).ok());
  EXPECT_LT(service.scheduler().Workers().front().busy(), kSlots) << "others are heard in between";
  service.ports().Run();
  EXPECT_EQ(service.scheduler().Workers().front().busy(), kSlots);
}

TEST(CampaignLife, AnyWordOfAWorkerKeepsAllThatItWorksOn) {
  SimulatedService service("any_word");
  service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 2);
  const v1::Lease quick = service.Next(worker, Kind::kLease).lease();
  const v1::Lease slow = service.Next(worker, Kind::kLease).lease();
  for (int step = 0; step < 3; ++step) {  // no heartbeat comes through
    service.Advance(milliseconds(900));
    service.SendStates(worker, quick, step, 1);
  }
  service.SendStates(worker, slow, 0, 1);
  for (int ack = 0; ack < 4; ++ack) {
    EXPECT_FALSE(service.Next(worker, Kind::kAck).ack().refused());
  }
  EXPECT_EQ(service.Read().States(1)->size(), 4U);
}

TEST(CampaignLife, WhatAWorkerDoesNotNameForFourLeaseTimesGoesToAnother) {
  SimulatedService service("unnamed");
  service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 2);
  const v1::Lease known = service.Next(worker, Kind::kLease).lease();
  const v1::Lease unknown = service.Next(worker, Kind::kLease).lease();
  v1::Heartbeat heartbeat;
  heartbeat.add_attempts(known.attempt());
  for (int beat = 0; beat < 9; ++beat) {
    service.Advance(milliseconds(500));
    EXPECT_TRUE(service.scheduler().Receive(worker, heartbeat).ok());
    service.ports().Run();
  }
  const v1::Lease again = service.Next(worker, Kind::kLease).lease();
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(again.spec(), unknown.spec()));
  service.SendStates(worker, known, 0, 1);
  EXPECT_FALSE(service.Next(worker, Kind::kAck).ack().refused());
}

TEST(CampaignLife, AServerThatStoodStillLosesNoLease) {
  SimulatedService service("stood_still");
  service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease lease = service.Next(worker, Kind::kLease).lease();
  service.StandStill(std::chrono::seconds(20));
  service.Advance(milliseconds(900));
  service.SendStates(worker, lease, 0, 4);
  EXPECT_EQ(service.Next(worker, Kind::kAck).ack().up_to(), 4);
  service.Advance(milliseconds(2000));  // the worker is silent now
  EXPECT_TRUE(service.Next(worker, Kind::kAck).ack().refused());
}

TEST(CampaignLife, WorkerKeepsItsAttemptAcrossARestartOfTheServer) {
  SimulatedService service("readopt");
  service.Submit(Small());
  const std::int64_t before = service.Connect("w", 1);
  const v1::Lease lease = service.Next(before, Kind::kLease).lease();
  service.Restart();
  const std::int64_t after = service.Connect("w", 1, {lease.attempt()});
  service.SendStates(after, lease, 0, 4);
  EXPECT_EQ(service.Next(after, Kind::kAck).ack().up_to(), 4);
  service.SendEnd(after, lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_TRUE(service.Next(after, Kind::kAck).ack().finished());
}

TEST(CampaignLife, WhatComesWhileCampaignsAreReadWaitsForThem) {
  SimulatedService service("early");
  service.Submit(Small());
  const std::int64_t before = service.Connect("w", 1);
  const v1::Lease lease = service.Next(before, Kind::kLease).lease();
  service.BeginRestart();
  Scheduler& scheduler = service.scheduler();
  EXPECT_EQ(scheduler.being_read(), 1U);
  EXPECT_FALSE(scheduler.Live(1).has_value());
  v1::Hello hello = testing::MatchingHello("w", 1);
  hello.add_attempts(lease.attempt());
  EXPECT_TRUE(scheduler.Connected(101, hello).ok());
  EXPECT_TRUE(scheduler.Connected(102, testing::MatchingHello("gone", 1)).ok());
  scheduler.Disconnected(102);
  v1::Hello other = testing::MatchingHello("w", 1);  // another process of this name
  other.set_instance("another");
  EXPECT_TRUE(scheduler.Connected(103, other).ok());
  absl::Status paused = absl::UnknownError("no answer");
  scheduler.Pause(1, nullptr, [&paused](const absl::Status& status) { paused = status; });
  EXPECT_TRUE(absl::IsUnknown(paused));
  EXPECT_TRUE(scheduler.Workers().empty());
  EXPECT_EQ(service.Next(101, Kind::kWelcome).message_case(), Kind::MESSAGE_NOT_SET);

  service.ports().Run();
  EXPECT_EQ(scheduler.being_read(), 0U);
  EXPECT_TRUE(paused.ok()) << paused;
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kPaused);
  EXPECT_TRUE(service.Next(101, Kind::kWelcome).has_welcome());
  EXPECT_EQ(service.ports().closed, std::vector<std::int64_t>{103});
  ASSERT_EQ(scheduler.Workers().size(), 1U);
  EXPECT_EQ(scheduler.Workers().front().busy(), 1);
  service.SendStates(101, lease, 0, 4);
  EXPECT_EQ(service.Next(101, Kind::kAck).ack().up_to(), 4);
}

TEST(CampaignLife, AServerThatEndsReadsNoMoreCampaigns) {
  SimulatedService service("ends");
  service.Submit(Small());
  service.BeginRestart();
  absl::Status paused = absl::UnknownError("no answer");
  service.scheduler().Pause(1, nullptr, [&paused](const absl::Status& status) { paused = status; });
  service.scheduler().StopReading();
  EXPECT_TRUE(absl::IsUnavailable(paused)) << paused;
  service.ports().Run();
  EXPECT_EQ(service.scheduler().being_read(), 1U) << "it is left";
  EXPECT_FALSE(service.scheduler().Live(1).has_value());
}

// A server that cannot read a campaign gives back its attempts, and may end before it has read it.
TEST(CampaignLife, WhatRunsByTheStoreAndByNoAttemptIsLeasedByTheNextServer) {
  SimulatedService service("unleased");
  service.Submit(Small());
  const std::int64_t before = service.Connect("w", 1);
  const v1::Lease lease = service.Next(before, Kind::kLease).lease();
  service.Write([&](store::Transaction& t) {
    t.EndAttempt({.id = lease.attempt(), .outcome = store::AttemptOutcome::kStopped});
  });
  service.Restart();
  const std::int64_t after = service.Connect("w", 1, {lease.attempt()});
  EXPECT_TRUE(service.Next(after, Kind::kAck).ack().refused());
  const v1::Lease again = service.Next(after, Kind::kLease).lease();
  EXPECT_GT(again.attempt(), lease.attempt());
  EXPECT_EQ(again.run(), lease.run()) << "it is the first that waits";
}

TEST(CampaignLife, LeavingWorkerGivesBackWhatIsOnItsWayToIt) {
  SimulatedService service("leaving");
  service.Submit(Small());
  const std::int64_t leaving = service.Connect("leaving", 1);
  const std::int64_t lost = service.Next(leaving, Kind::kLease).lease().attempt();
  service.scheduler().Receive(leaving, v1::Leaving());
  service.ports().Run();
  const std::int64_t other = service.Connect("other", 1);
  EXPECT_GT(service.Next(other, Kind::kLease).lease().attempt(), lost);
  EXPECT_EQ(service.Read().Evaluations(1)->front().failures, 0) << "leaving is no failure";
}

TEST(CampaignLife, CancelStopsWhatRuns) {
  SimulatedService service("cancel");
  service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease lease = service.Next(worker, Kind::kLease).lease();
  absl::Status cancelled = absl::UnknownError("no answer");
  service.scheduler().Cancel(1, nullptr, [&](const absl::Status& status) { cancelled = status; });
  service.ports().Run();
  EXPECT_TRUE(cancelled.ok()) << cancelled;
  EXPECT_EQ(service.Next(worker, Kind::kStop).stop().attempt(), lease.attempt());
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kCancelled);
  service.SendStates(worker, lease, 0, 1);
  EXPECT_TRUE(service.Next(worker, Kind::kAck).ack().refused());
}

TEST(CampaignLife, WhatOtherMechanicsHaveBegunWaitsForAWord) {
  constexpr const char* kOld = "of another version";
  SimulatedService calm("not_upgraded");
  calm.Submit(Small());
  calm.RunToEnd(1, true);
  SimulatedService service("upgraded");
  service.Submit(Small());
  const auto digest = [&service](std::size_t k) {
    return Value(service.Read().Evaluations(1))[k].digest;
  };
  // Nothing has run: there is nothing to be mixed.
  const std::string first = digest(0);
  service.Write([](store::Transaction& t) { t.BeginAnew({1, 0, 0}, kOld); });
  service.Restart();
  EXPECT_EQ(digest(0), first);
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kQueued);
  // One has ended, another one has come half its way.
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease done = service.Next(worker, Kind::kLease).lease();
  service.SendStates(worker, done, 0, 4);
  service.SendEnd(worker, done.attempt(), v1::Finished::OUTCOME_COMPLETED);
  const store::EvaluationKey half{1, 1, 0};
  const std::string second = digest(1);
  service.SendStates(worker, service.Next(worker, Kind::kLease).lease(), 0, 2);
  const auto states = Value(service.Read().States(1, 1));
  ASSERT_EQ(states.size(), 2U);
  service.Write([&half, &states](store::Transaction& t) {
    t.BeginAnew(half, kOld);
    for (store::StateRecord state : states) {
      state.observables.front() *= 2;
      t.PutState(state, 0);
    }
  });
  service.Restart();
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kPaused);
  EXPECT_NE(service.Campaign().progress.reason.find("other mechanics"), std::string::npos);
  EXPECT_EQ(digest(1), kOld);
  service.scheduler().Resume(
      1, nullptr, [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; });
  service.ports().Run();
  EXPECT_EQ(digest(1), second);
  EXPECT_TRUE(Value(service.Read().States(1, 1)).empty());
  service.RunToEnd(1, true);
  EXPECT_TRUE(service.Fingerprint() == calm.Fingerprint());
}

// Whatever is on the disk when the server is killed: the failure and the pause that follows from
// it, or neither.
TEST(CampaignLife, AFailureThatPausesIsWrittenWithItsPauseOrNotAtAll) {
  for (const auto outcome : {v1::Finished::OUTCOME_FAILED, v1::Finished::OUTCOME_DIVERGED}) {
    for (int writes = 0; writes < 3; ++writes) {
      SCOPED_TRACE(writes);
      SimulatedService service("failed");
      testing::SmallCampaign campaign =
          testing::MakeSmallCampaign({.samples = 4, .failure_attempts = 1});
      const std::string pause = "pause_above: 0.5";
      campaign.yaml.replace(campaign.yaml.find(pause), pause.size(), "pause_above: 0.01");
      service.Submit(campaign);
      const std::int64_t worker = service.Connect("w", 1);
      for (int i = 0; i < 3; ++i) {
        const v1::Lease done = service.Next(worker, Kind::kLease).lease();
        service.SendStates(worker, done, 0, 4);
        service.SendEnd(worker, done.attempt(), v1::Finished::OUTCOME_COMPLETED);
      }
      v1::Finished finished;
      finished.set_attempt(service.Next(worker, Kind::kLease).lease().attempt());
      finished.set_outcome(outcome);
      finished.set_reason("no such thing");
      service.scheduler().Receive(worker, finished);
      for (int i = 0; i < writes; ++i) service.ports().RunOne();
      service.Restart();
      int ended = 0;
      for (const auto& evaluation : Value(service.Read().Evaluations(1))) {
        ended += evaluation.status == store::EvaluationStatus::kFailed ||
                         evaluation.status == store::EvaluationStatus::kDiverged
                     ? 1
                     : 0;
      }
      EXPECT_EQ(ended, writes == 0 ? 0 : 1);
      EXPECT_EQ(service.Campaign().progress.state,
                ended > 0 ? store::CampaignState::kPaused : store::CampaignState::kRunning);
    }
  }
}

// All are planned before the first run has ended.
TEST(CampaignLife, WhatSeveralCampaignsWaitForIsRunOnce) {
  const auto run = [](SimulatedService& service, std::int64_t campaign) {
    const auto all = Value(service.Read().Evaluations(campaign));
    return std::count_if(all.begin(), all.end(), [](const auto& e) { return !e.reused; });
  };
  SimulatedService alone("alone");
  alone.Submit(Small());
  alone.RunToEnd(1, true);
  SimulatedService service("several");
  for (int i = 0; i < 3; ++i) service.Submit(Small());
  // Two at a time: none of them twice.
  const std::int64_t worker = service.Connect("w", 2);
  const v1::Lease first = service.Next(worker, Kind::kLease).lease();
  const v1::Lease second = service.Next(worker, Kind::kLease).lease();
  EXPECT_FALSE(google::protobuf::util::MessageDifferencer::Equals(first.spec(), second.spec()));
  service.scheduler().Receive(worker, v1::Leaving());
  service.ports().Run();
  service.RunToEnd(1, true);
  EXPECT_EQ(run(service, 1) + run(service, 2) + run(service, 3), run(alone, 1));
  for (const std::int64_t campaign : {1, 2, 3}) {
    EXPECT_EQ(Value(service.Read().Campaign(campaign)).progress.state,
              store::CampaignState::kFinished);
    EXPECT_TRUE(service.Runs(campaign) == alone.Runs(1)) << campaign;
  }
}

TEST(CampaignLife, SeveralCampaignsHaveTheSameBitsWhateverGoesWrong) {
  for (const std::string method : {"iterative_bayesian_filter", "tmcmc", "surrogate_msrs"}) {
    const auto campaign =
        testing::MakeSmallCampaign({.samples = 20, .failure_attempts = 100, .method = method});
    SimulatedService alone("alone");
    alone.Submit(campaign);
    alone.RunToEnd(1, true);
    for (unsigned seed = 1; seed <= 10; ++seed) {
      SimulatedService service("several_in_a_storm");
      for (int i = 0; i < 2; ++i) service.Submit(campaign);
      service.RunToEnd(seed, false);
      for (const std::int64_t id : {1, 2}) {
        EXPECT_EQ(Value(service.Read().Campaign(id)).progress.state,
                  store::CampaignState::kFinished)
            << method << seed;
        EXPECT_TRUE(service.Runs(id) == alone.Runs(1)) << method << ", " << id << ", seed " << seed;
      }
    }
  }
}

// Whoever computes it may go: the others do not wait for ever.
TEST(CampaignLife, ACancelledCampaignLeavesWhatOthersWaitFor) {
  SimulatedService service("cancelled_twin");
  for (int i = 0; i < 2; ++i) service.Submit(Small());
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease of_first = service.Next(worker, Kind::kLease).lease();
  service.SendStates(worker, of_first, 0, 2);
  service.scheduler().Cancel(
      1, nullptr, [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; });
  service.ports().Run();
  const v1::Lease of_second = service.Next(worker, Kind::kLease).lease();
  EXPECT_TRUE(
      google::protobuf::util::MessageDifferencer::Equals(of_second.spec(), of_first.spec()));
  EXPECT_NE(of_second.attempt(), of_first.attempt());
}

TEST(CampaignLife, SameBitsWhateverGoesWrong) {
  SimulatedService calm("calm");
  calm.Submit(Small());
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SimulatedService service("storm");
    service.Submit(Small());
    service.RunToEnd(seed, false);
    EXPECT_TRUE(service.Fingerprint() == expected) << "seed " << seed;
  }
}

}  // namespace
}  // namespace calib::scheduler
