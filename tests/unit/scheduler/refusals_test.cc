// What a worker says that cannot be, and what the store refuses: nobody else is the worse for it.
#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ToldKind = v1::ServerMessage::MessageCase;

testing::SmallCampaign SixSamples() {
  return testing::MakeSmallCampaign({.samples = 6, .max_iterations = 2, .failure_attempts = 3});
}

TEST(Refusals, AWorkerOfAMillionSlotsTakesNoLease) {
  SimulatedService service("slots");
  service.Submit(SixSamples());
  v1::Hello hello = testing::MatchingHello("greedy", 4096);
  const absl::Status status = service.scheduler().Connected(77, hello);
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(status.message().find("--max-slots"), std::string::npos) << status;
  const std::int64_t worker = service.Connect("modest", 1);
  EXPECT_TRUE(service.Next(worker, ToldKind::kLease).has_lease());
}

TEST(Refusals, MoreAttemptsThanItsSlotsCanHoldEndTheStreamAndOthersAreRefusedOneByOne) {
  SimulatedService service("attempts");
  const std::int64_t worker = service.Connect("w", 2);
  v1::Heartbeat heartbeat;
  for (int k = 1; k <= 8; ++k) heartbeat.add_attempts(1'000'000 + k);
  EXPECT_TRUE(service.scheduler().Receive(worker, heartbeat).ok());
  for (int k = 1; k <= 8; ++k) {
    const v1::Ack ack = service.Next(worker, ToldKind::kAck).ack();
    EXPECT_TRUE(ack.refused());
    EXPECT_EQ(ack.attempt(), 1'000'000 + k);
  }
  heartbeat.add_attempts(7);
  EXPECT_EQ(service.scheduler().Receive(worker, heartbeat).code(),
            absl::StatusCode::kInvalidArgument);
  const std::int64_t large = service.Connect("large", 50);
  v1::Heartbeat flood;
  for (int k = 1; k <= 200; ++k) flood.add_attempts(2'000'000 + k);
  for (const int at_once : {64, 64}) {
    EXPECT_TRUE(service.scheduler().Receive(large, flood).ok());
    int answers = 0;
    while (service.Next(large, ToldKind::kAck).has_ack()) ++answers;
    EXPECT_EQ(answers, at_once) << "a flood of heartbeats is no flood of answers";
  }
  v1::Hello hello = testing::MatchingHello("other", 1);
  for (int k = 1; k <= 5; ++k) hello.add_attempts(k);
  EXPECT_EQ(service.scheduler().Connected(78, hello).code(), absl::StatusCode::kInvalidArgument);
}

TEST(Refusals, AMessageThatBreaksARuleFailsItsAttemptAndPausesWithItsReasonInTheEnd) {
  SimulatedService service("rejected");
  service.Submit(SixSamples());
  const std::int64_t worker = service.Connect("w", 1);
  for (int k = 0; k < 3; ++k) {
    const v1::Lease lease = service.Next(worker, ToldKind::kLease).lease();
    ASSERT_GT(lease.attempt(), 0);
    service.scheduler().Reject(worker, lease.attempt(), "core_seconds is nan");
    service.ports().Run();
    EXPECT_TRUE(service.Next(worker, ToldKind::kAck).ack().refused());
  }
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kPaused);
  EXPECT_NE(service.Campaign().progress.reason.find("core_seconds is nan"), std::string::npos);
  service.scheduler().Reject(worker, 999, "of nobody");
  service.ports().Run();
}

TEST(Refusals, AnAttemptIsNotAnotherWorkersToFail) {
  SimulatedService service("stranger");
  service.Submit(SixSamples());
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease lease = service.Next(worker, ToldKind::kLease).lease();
  const std::int64_t stranger = service.Connect("stranger", 1);
  service.scheduler().Reject(stranger, lease.attempt(), "not yours");
  service.ports().Run();
  service.SendStates(worker, lease, 0, 4);
  EXPECT_EQ(service.Next(worker, ToldKind::kAck).ack().up_to(), 4);
}

TEST(Refusals, MoreStatesThanThePathHasFailTheAttempt) {
  SimulatedService service("states");
  service.Submit(SixSamples());
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease lease = service.Next(worker, ToldKind::kLease).lease();
  v1::StateBatch batch;
  batch.set_attempt(lease.attempt());
  for (int k = 0; k < 1000; ++k) batch.add_states()->set_load_step(0);
  service.scheduler().Receive(worker, batch);
  service.ports().Run();
  EXPECT_TRUE(service.Next(worker, ToldKind::kAck).ack().refused());
  EXPECT_TRUE(Value(service.Read().States(1)).empty());
}

// A core time that is no number, past the rules that the service holds messages to.
TEST(Refusals, AWriteThatTheStoreRefusesPausesItsCampaignAloneWhichThenEndsWithTheSameBits) {
  SimulatedService calm("refused_write_calm");
  calm.Submit(SixSamples());
  calm.RunToEnd(1, true);

  SimulatedService service("refused_write");
  service.Submit(SixSamples());
  const std::int64_t worker = service.Connect("w0", 2);
  const v1::Lease lease = service.Next(worker, ToldKind::kLease).lease();
  const v1::Lease beside = service.Next(worker, ToldKind::kLease).lease();
  service.SendStates(worker, lease, 0, 4);
  service.core_seconds = std::numeric_limits<double>::quiet_NaN();
  service.SendEnd(worker, lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  service.core_seconds = 0;
  EXPECT_EQ(std::exchange(service.ports().refused, 0), 1);
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kPaused);
  EXPECT_NE(service.Campaign().progress.reason.find("the store refuses"), std::string::npos);
  EXPECT_EQ(service.scheduler().live(), 1U);
  service.SendStates(worker, beside, 0, 4);
  EXPECT_TRUE(service.Next(worker, ToldKind::kAck).has_ack()) << "it is told, not waited for";

  absl::Status resumed = absl::UnknownError("");
  service.scheduler().Resume(1, nullptr, [&](const absl::Status& status) { resumed = status; });
  service.ports().Run();
  EXPECT_TRUE(resumed.ok()) << resumed;
  service.scheduler().Disconnected(worker);
  service.RunToEnd(1, true);
  EXPECT_TRUE(service.Runs(1) == calm.Runs(1));
}

TEST(Refusals, WhatIsAskedOfACampaignThatIsBeingLoadedIsDoneAfterwards) {
  SimulatedService service("loading");
  service.Submit(SixSamples());
  service.Restart();
  std::string id;
  absl::Status paused = absl::UnknownError("not yet");
  service.scheduler().Submit(
      {.name = "again", .yaml = SixSamples().yaml, .file_name = "small.yaml", .samples = 6},
      Value(service.Read().Files(1)), "", {},
      [&](const absl::StatusOr<std::string>& answer) { id = *answer; });
  service.ports().RunOne();  // it is on disk and not yet loaded
  EXPECT_EQ(id, "c2");
  service.scheduler().Pause(2, nullptr, [&](const absl::Status& status) { paused = status; });
  EXPECT_EQ(paused.message(), "not yet");
  service.ports().Run();
  EXPECT_TRUE(paused.ok()) << paused;
  EXPECT_EQ(Value(service.Read().Campaign(2)).progress.state, store::CampaignState::kPaused);
}

TEST(Refusals, TheViewOfARunningIterationIsComputedAside) {
  SimulatedService service("view");
  service.Submit(SixSamples());
  const std::int64_t worker = service.Connect("w", 6);
  for (int k = 0; k < 6; ++k) {
    service.SendStates(worker, service.Next(worker, ToldKind::kLease).lease(), 0, 2);
  }
  EXPECT_EQ(service.scheduler().Live(1)->view.best_misfit, 0) << "nobody has looked before";
  const std::uint64_t before = service.scheduler().version();
  service.ports().Run();
  EXPECT_GT(service.scheduler().version(), before) << "who watches looks again";
  const LiveView view = service.scheduler().Live(1)->view;
  EXPECT_GT(view.best_misfit, 0);
  EXPECT_GT(view.effective_samples, 0);
  const std::uint64_t seen = service.scheduler().version();
  service.ports().Run();
  EXPECT_EQ(service.scheduler().version(), seen) << "nothing has changed, nothing is computed";
}

TEST(Refusals, MoreCampaignsThanTheServerTakesAreRefused) {
  SimulatedService service("many");
  const testing::SmallCampaign campaign = SixSamples();
  service.Submit(campaign);
  const auto files = Value(service.Read().Files(1));
  absl::Status last;
  int taken = 1;
  for (int k = 0; k < 1000 && last.ok(); ++k) {
    service.scheduler().Submit(
        {.name = "again", .yaml = campaign.yaml, .file_name = "small.yaml", .samples = 6}, files,
        "", {}, [&](const absl::StatusOr<std::string>& answer) {
          last = answer.status();
          taken += answer.ok() ? 1 : 0;
        });
    service.ports().Run();
  }
  EXPECT_EQ(last.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(taken, kMostCampaigns);
}

}  // namespace
}  // namespace calib::scheduler
