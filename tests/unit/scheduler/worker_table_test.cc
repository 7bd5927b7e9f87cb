#include "server/scheduler/leases/worker_table.h"

#include <gtest/gtest.h>

namespace calib::scheduler {
namespace {

using std::chrono::seconds;

constexpr Clock::time_point kStart{};

v1::Hello Hello(const std::string& name, int slots) {
  v1::Hello hello;
  hello.set_name(name);
  hello.set_slots(slots);
  hello.set_instance("1");
  return hello;
}

TEST(WorkerTable, WorkGoesToTheWorkerWithMostFreeSlots) {
  WorkerTable workers;
  LeaseTable leases(seconds(10));
  EXPECT_TRUE(workers.Free(leases, kStart).empty());
  workers.Connect(Hello("a", 1), 1, kStart);
  workers.Connect(Hello("b", 2), 2, kStart);
  EXPECT_EQ(workers.Free(leases, kStart).front()->hello.name(), "b");
  leases.Grant(1, {.campaign = 1, .sample = 0, .experiment = 0}, "b", kStart);
  EXPECT_EQ(workers.Free(leases, kStart).front()->hello.name(), "a") << "ties go by name";
  leases.Grant(2, {.campaign = 1, .sample = 1, .experiment = 0}, "a", kStart);
  leases.Grant(3, {.campaign = 1, .sample = 2, .experiment = 0}, "b", kStart);
  EXPECT_TRUE(workers.Free(leases, kStart).empty());
  EXPECT_EQ(workers.Slots(), 3);
}

TEST(WorkerTable, SilentDrainingAndGoneWorkersGetNothing) {
  WorkerTable workers;
  const LeaseTable leases(seconds(10));
  workers.Connect(Hello("a", 1), 1, kStart);
  EXPECT_TRUE(workers.Free(leases, kStart + seconds(1)).empty()) << "silent";
  workers.Find("a")->draining = true;
  EXPECT_TRUE(workers.Free(leases, kStart).empty());
  workers.Find("a")->draining = false;
  workers.Disconnect(1);
  EXPECT_TRUE(workers.Free(leases, kStart).empty());
}

TEST(WorkerTable, NewStreamReplacesTheOldOne) {
  WorkerTable workers;
  EXPECT_EQ(workers.Connect(Hello("a", 1), 1, kStart), 0);
  EXPECT_EQ(workers.Connect(Hello("a", 1), 2, kStart), 1);
  workers.Disconnect(1);  // the old stream's end comes late
  EXPECT_EQ(workers.Find("a")->session, 2);
  EXPECT_EQ(workers.OfSession(1), nullptr);
}

TEST(WorkerTable, AnotherProcessOfTheNameOfOneThatIsConnectedIsAnother) {
  const auto of = [](const std::string& instance) {
    v1::Hello hello = Hello("a", 1);
    hello.set_instance(instance);
    return hello;
  };
  WorkerTable workers;
  EXPECT_FALSE(workers.IsAnother(of("1"), kStart)) << "nobody bears the name";
  workers.Connect(of("1"), 1, kStart);
  EXPECT_FALSE(workers.IsAnother(of("1"), kStart)) << "its own reconnect";
  EXPECT_TRUE(workers.IsAnother(of("2"), kStart));
  EXPECT_TRUE(workers.IsAnother(of(""), kStart)) << "who does not tell takes over no name";
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart + seconds(1))) << "it is silent for too long";
  workers.Find("a")->leaving = true;
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart)) << "it has said that it leaves";
  workers.Find("a")->leaving = false;
  workers.Disconnect(1);
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart)) << "killed, its stream is closed";
}

TEST(WorkerTable, OfVeryManyTheOneLongestGoneIsForgotten) {
  constexpr int kMany = 5000;
  WorkerTable workers;
  workers.Connect(Hello("there", 1), 1, kStart);
  for (int k = 0; k < kMany; ++k) {
    const std::int64_t session = k + 2;
    v1::Hello hello = Hello(std::to_string(k), 1);
    hello.add_attempts(1);
    workers.Connect(hello, session, kStart + seconds(k));
    workers.Disconnect(session);
  }
  EXPECT_LT(workers.all().size(), static_cast<std::size_t>(kMany));
  EXPECT_NE(workers.Find("there"), nullptr);
  EXPECT_EQ(workers.Find("0"), nullptr);
  ASSERT_NE(workers.Find(std::to_string(kMany - 1)), nullptr);
  EXPECT_EQ(workers.Find(std::to_string(kMany - 1))->hello.attempts_size(), 0)
      << "what it held is looked at once";
}

TEST(WorkerTable, DrainedWorkerThatIsStartedAgainWorks) {
  WorkerTable workers;
  workers.Connect(Hello("a", 1), 1, kStart);
  workers.Find("a")->draining = true;
  workers.Connect(Hello("a", 1), 2, kStart);
  EXPECT_TRUE(workers.Find("a")->draining) << "a lost connection does not end a drain";
  workers.Find("a")->leaving = true;
  workers.Connect(Hello("a", 1), 3, kStart);
  EXPECT_FALSE(workers.Find("a")->draining);
}

TEST(WorkerTable, GoneWorkersAreForgottenAfterAWhile) {
  WorkerTable workers;
  workers.Connect(Hello("a", 1), 1, kStart);
  workers.ForgetGone(kStart + seconds(1));
  EXPECT_NE(workers.Find("a"), nullptr) << "it is connected";
  workers.Disconnect(1);
  workers.ForgetGone(kStart + seconds(1));
  EXPECT_EQ(workers.Find("a"), nullptr);
}

}  // namespace
}  // namespace calib::scheduler
