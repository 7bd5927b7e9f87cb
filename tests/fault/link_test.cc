// Doubled, late and forged messages, and cut streams, by a worker that says what the test tells it
// to say.
#include <gtest/gtest.h>

#include "dem/registry/catalog.h"
#include "tests/fault/undisturbed.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kSoon{10};
constexpr std::chrono::milliseconds kSilence{150};

class Link : public ::testing::Test {
 protected:
  // So long a lease that a busy machine does not let it expire between two messages of a test.
  explicit Link(int lease_ms = 20000)
      : deployment_({.name = "link", .lease_ms = lease_ms, .heartbeat_ms = 100}) {}

  void SetUp() override {
    ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
    client_ = deployment_.client();
    const SmallCampaign campaign = MakeSmallCampaign(
        {.samples = 8, .max_iterations = 1, .load_steps = 2, .inference = "  replicates: 0\n"});
    ASSERT_TRUE(client_.SubmitCampaign(campaign.yaml, campaign.files, "r").ok());
  }

  static v1::WorkerMessage States(std::int64_t attempt, int first, int count, double value = 1.5) {
    v1::WorkerMessage message;
    message.mutable_states()->set_attempt(attempt);
    message.mutable_states()->set_first(first);
    for (int i = 0; i < count; ++i) {
      v1::State& state = *message.mutable_states()->add_states();
      state.set_load_step(first + i);
      for (std::size_t k = 0; k < dem::FindTest("triaxial_drained")->observables.size(); ++k) {
        state.add_values(value);
      }
    }
    return message;
  }

  static v1::WorkerMessage Finished(
      std::int64_t attempt, v1::Finished::Outcome outcome = v1::Finished::OUTCOME_COMPLETED) {
    v1::WorkerMessage message;
    message.mutable_finished()->set_attempt(attempt);
    message.mutable_finished()->set_outcome(outcome);
    return message;
  }

  std::size_t StoredStates() { return StatesNow(client_).size(); }

  /// The attempt that the server leases next.
  static std::int64_t NextLease(FakeWorker& worker) {
    const auto message = worker.Receive(v1::ServerMessage::kLease, kSoon);
    EXPECT_TRUE(message.has_value());
    return message.has_value() ? message->lease().attempt() : 0;
  }

  static v1::Ack NextAck(FakeWorker& worker) {
    const auto message = worker.Receive(v1::ServerMessage::kAck, kSoon);
    EXPECT_TRUE(message.has_value());
    return message.has_value() ? message->ack() : v1::Ack();
  }

  Deployment deployment_;
  Client client_{"unused:0"};  // the server's once it runs
};

class ShortLease : public Link {
 protected:
  ShortLease() : Link(400) {}
};

TEST_F(Link, StatesAreAcknowledgedOnceTheyAreStoredAndDoublesAreHarmless) {
  FakeWorker worker(deployment_.address(), MatchingHello("fake", 1));
  const std::int64_t attempt = NextLease(worker);
  worker.Send(States(attempt, 0, 1));
  EXPECT_EQ(NextAck(worker).up_to(), 1);
  EXPECT_EQ(StoredStates(), 1U);
  worker.Send(States(attempt, 0, 1));
  EXPECT_EQ(NextAck(worker).up_to(), 1);
  EXPECT_EQ(StoredStates(), 1U);
  worker.Send(States(attempt, 1, 1));
  EXPECT_EQ(NextAck(worker).up_to(), 2);
  worker.Send(Finished(attempt));
  EXPECT_TRUE(NextAck(worker).finished());
  worker.Send(Finished(attempt));
  EXPECT_TRUE(NextAck(worker).refused()) << "its end is stored; nothing more is wanted of it";
  EXPECT_EQ(client_.Show("c1")->samples_done(), 1);
}

TEST_F(ShortLease, LateMessagesOfAnExpiredAttemptAreRefused) {
  FakeWorker late(deployment_.address(), MatchingHello("late", 1));
  const std::int64_t attempt = NextLease(late);
  ASSERT_TRUE(Eventually(kSoon, [&] { return client_.Workers()->workers(0).busy() == 0; }));
  late.Send(States(attempt, 0, 1));
  EXPECT_TRUE(NextAck(late).refused());
  late.Send(Finished(attempt));
  EXPECT_TRUE(NextAck(late).refused());
  EXPECT_EQ(StoredStates(), 0U);
}

TEST_F(Link, AnAttemptOfAnotherWorkerIsRefused) {
  FakeWorker owner(deployment_.address(), MatchingHello("owner", 1));
  const std::int64_t attempt = NextLease(owner);
  FakeWorker thief(deployment_.address(), MatchingHello("thief", 1));
  NextLease(thief);
  thief.Send(States(attempt, 0, 2));
  EXPECT_TRUE(NextAck(thief).refused());
  EXPECT_EQ(StoredStates(), 0U);
}

TEST_F(Link, WorkerGoesOnAfterACutStreamAndResendsWhatWasNotAcknowledged) {
  v1::Hello hello = MatchingHello("cut", 1);
  std::int64_t attempt = 0;
  {
    FakeWorker worker(deployment_.address(), hello);
    attempt = NextLease(worker);
    worker.Send(States(attempt, 0, 1));
    EXPECT_EQ(NextAck(worker).up_to(), 1);
    worker.Cut();
  }
  hello.add_attempts(attempt);
  FakeWorker worker(deployment_.address(), hello);
  worker.Send(States(attempt, 0, 2));
  EXPECT_EQ(NextAck(worker).up_to(), 2);
  worker.Send(Finished(attempt));
  EXPECT_TRUE(NextAck(worker).finished());
  EXPECT_EQ(client_.Samples("c1")->front().attempts(), 1) << "nothing was run twice";
}

TEST_F(Link, AttemptTheWorkerNoLongerHasIsLeasedAgainAtOnce) {
  std::int64_t first = 0;
  {
    FakeWorker worker(deployment_.address(), MatchingHello("restarted", 1));
    first = NextLease(worker);
    worker.Cut();
  }
  FakeWorker worker(deployment_.address(), MatchingHello("restarted", 1));
  EXPECT_GT(NextLease(worker), first);
}

TEST_F(Link, IncompleteAndUnreadableResultsAreRunAgain) {
  FakeWorker worker(deployment_.address(), MatchingHello("liar", 1));
  std::int64_t attempt = NextLease(worker);
  worker.Send(States(attempt, 0, 1));
  EXPECT_EQ(NextAck(worker).up_to(), 1);
  worker.Send(Finished(attempt));  // one of two load steps is missing
  EXPECT_TRUE(NextAck(worker).refused());
  attempt = NextLease(worker);
  worker.Send(States(attempt, 1, 1, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_TRUE(NextAck(worker).refused());
  attempt = NextLease(worker);
  worker.Send(States(attempt, 1, 5));  // load steps that do not exist
  EXPECT_TRUE(NextAck(worker).refused());
  EXPECT_EQ(client_.Show("c1")->samples_done(), 0);
}

TEST_F(Link, SampleThatKeepsFailingPausesTheCampaignWithItsReason) {
  FakeWorker worker(deployment_.address(), MatchingHello("broken", 1));
  for (int i = 0; i < 5; ++i) {
    v1::WorkerMessage failed = Finished(NextLease(worker), v1::Finished::OUTCOME_FAILED);
    failed.mutable_finished()->set_reason("out of memory");
    worker.Send(failed);
  }
  ASSERT_TRUE(Eventually(kSoon, [&] { return client_.Show("c1")->state() == "paused"; }));
  EXPECT_NE(client_.Show("c1")->reason().find("out of memory"), std::string::npos);
  EXPECT_FALSE(worker.Receive(v1::ServerMessage::kLease, kSilence).has_value());
  v1::ControlRequest request;
  request.set_campaign("c1");
  EXPECT_TRUE(client_.Resume(request).ok());
  EXPECT_GT(NextLease(worker), 0);
}

TEST_F(Link, CampaignIsPausedWhenTooManySamplesDiverge) {
  FakeWorker worker(deployment_.address(), MatchingHello("diverging", 1));
  for (int i = 0; i < 5; ++i) {  // more than half of eight
    v1::WorkerMessage diverged = Finished(NextLease(worker), v1::Finished::OUTCOME_DIVERGED);
    diverged.mutable_finished()->set_reason("grains were lost");
    worker.Send(diverged);
    EXPECT_TRUE(NextAck(worker).finished());
  }
  ASSERT_TRUE(Eventually(kSoon, [&] { return client_.Show("c1")->state() == "paused"; }));
  EXPECT_EQ(client_.Show("c1")->samples_diverged(), 5);
  EXPECT_EQ(client_.Samples("c1")->front().reason(), "grains were lost");
  v1::ControlRequest request;
  request.set_campaign("c1");
  ASSERT_TRUE(client_.Resume(request).ok());
  for (int i = 5; i < 8; ++i) {
    const std::int64_t attempt = NextLease(worker);
    worker.Send(States(attempt, 0, 2, 1 + 0.1 * i));
    worker.Send(Finished(attempt));
  }
  ASSERT_TRUE(Eventually(kSoon, [&] { return client_.Show("c1")->state() == "finished"; }));
  const auto samples = client_.Samples("c1");
  EXPECT_EQ(samples->front().weight(), 0);
  EXPECT_GT(samples->back().weight(), 0);
}

}  // namespace
}  // namespace calib::testing
