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

int One(const WorkerTable::Kind& /*kind*/) { return 1; }

// nullptr where it would have to wait.
const WorkerEntry* FreeOf(const WorkerTable::Choice& choice) {
  return choice.missing == 0 ? choice.worker : nullptr;
}

std::string Freest(const WorkerTable& workers) {
  const WorkerEntry* worker = FreeOf(workers.Freest(One));
  return worker == nullptr ? "" : worker->hello.name();
}

TEST(WorkerTable, WorkGoesToTheWorkerWithMostFreeSlots) {
  WorkerTable workers;
  EXPECT_FALSE(workers.AnyFree());
  workers.Connect(Hello("a", 1), 1, 0, kStart);
  workers.Connect(Hello("b", 2), 2, 0, kStart);
  EXPECT_EQ(Freest(workers), "b");
  workers.SetBusy("b", 1);
  EXPECT_EQ(Freest(workers), "a") << "ties go by name";
  workers.SetBusy("a", 1);
  workers.SetBusy("b", 2);
  EXPECT_FALSE(workers.AnyFree());
  EXPECT_EQ(workers.Slots(), 3);
  workers.SetBusy("b", 0);
  EXPECT_EQ(Freest(workers), "b");
  workers.Connect(Hello("b", 1), 3, 1, kStart);
  EXPECT_FALSE(workers.AnyFree()) << "it came back with the lease that it had";
  EXPECT_EQ(workers.Slots(), 2);
}

TEST(WorkerTable, SilentDrainingAndGoneWorkersGetNothing) {
  WorkerTable workers;
  workers.Connect(Hello("a", 1), 1, 0, kStart);
  workers.Review(kStart + seconds(1), kStart);
  EXPECT_FALSE(workers.AnyFree()) << "silent";
  bool was_silent = false;
  workers.Heard(1, kStart + seconds(1), &was_silent);
  EXPECT_TRUE(was_silent);
  EXPECT_EQ(Freest(workers), "a");
  workers.Drain("a");
  EXPECT_FALSE(workers.AnyFree());
  workers.Leave(1);
  workers.Connect(Hello("a", 1), 2, 0, kStart);
  EXPECT_EQ(Freest(workers), "a") << "started again";
  workers.Disconnect(2);
  EXPECT_FALSE(workers.AnyFree());
  EXPECT_EQ(workers.Slots(), 0);
}

TEST(WorkerTable, AThousandWorkersOfSixteenSlotsAreFilledInTurn) {
  constexpr int kWorkers = 1000;
  constexpr int kSlots = 16;
  WorkerTable workers;
  LeaseTable leases(seconds(10));
  for (int k = 0; k < kWorkers; ++k) {
    workers.Connect(Hello(std::to_string(k), kSlots), k + 1, 0, kStart);
  }
  for (std::int64_t attempt = 0; const WorkerEntry* worker = FreeOf(workers.Freest(One));
       ++attempt) {
    EXPECT_EQ(worker->busy, attempt / kWorkers) << "nobody gets a run more than the others";
    const std::string name = worker->hello.name();
    leases.Grant({.attempt = attempt, .key = {}, .worker = name, .started = kStart});
    workers.SetBusy(name, leases.Busy(name));
  }
  EXPECT_EQ(leases.OfCampaign(0).size(), static_cast<std::size_t>(kWorkers) * kSlots);
}

TEST(WorkerTable, WhoMayRunAProgramIsFoundAmongThoseWhoMayNot) {
  WorkerTable workers;
  const auto with = [](const std::string& name, int slots, const std::string& program) {
    v1::Hello hello = Hello(name, slots);
    hello.add_programs(program);
    hello.set_checkpoints("folder of " + name);
    return hello;
  };
  workers.Connect(with("a", 1, "yade"), 1, 0, kStart);
  workers.Connect(with("b", 9, "liggghts"), 2, 0, kStart);
  const auto yade = [](const WorkerTable::Kind& kind) {
    return kind.programs == std::vector<std::string>{"yade"} ? 1 : 0;
  };
  ASSERT_NE(FreeOf(workers.Freest(yade)), nullptr);
  EXPECT_EQ(FreeOf(workers.Freest(yade))->hello.name(), "a");
  EXPECT_EQ(Freest(workers), "b");
  EXPECT_EQ(workers.FreestAt("folder of b", yade).worker, nullptr);
  EXPECT_NE(workers.FreestAt("folder of a", yade).worker, nullptr);
  workers.SetBusy("a", 1);
  EXPECT_EQ(FreeOf(workers.Freest(yade)), nullptr);
  EXPECT_EQ(workers.FreestAt("folder of a", yade).worker, nullptr);
  EXPECT_TRUE(workers.IsThere("folder of a")) << "busy, but there";
  workers.Disconnect(1);
  EXPECT_FALSE(workers.IsThere("folder of a"));
}

TEST(WorkerTable, ARunOfSeveralSlotsIsToldWhereFewestAreMissing) {
  WorkerTable workers;
  workers.Connect(Hello("a", 4), 1, 3, kStart);
  workers.Connect(Hello("b", 4), 2, 2, kStart);
  workers.Connect(Hello("c", 2), 3, 0, kStart);
  const auto three = [](const WorkerTable::Kind& /*kind*/) { return 3; };
  EXPECT_EQ(workers.Freest(three).worker->hello.name(), "b") << "c will never have as many";
  EXPECT_EQ(workers.Freest(three).missing, 1);
  EXPECT_EQ(workers.Freest(three, {"b"}).worker->hello.name(), "a");
  workers.SetBusy("a", 1);
  EXPECT_EQ(workers.Freest(three).worker->hello.name(), "a");
  EXPECT_EQ(workers.Freest(three).missing, 0);
  const auto five = [](const WorkerTable::Kind& /*kind*/) { return 5; };
  EXPECT_EQ(workers.Freest(five).worker, nullptr);
}

TEST(WorkerTable, NewStreamReplacesTheOldOne) {
  WorkerTable workers;
  EXPECT_EQ(workers.Connect(Hello("a", 1), 1, 0, kStart), 0);
  EXPECT_EQ(workers.Connect(Hello("a", 1), 2, 0, kStart), 1);
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
  workers.Connect(of("1"), 1, 0, kStart);
  EXPECT_FALSE(workers.IsAnother(of("1"), kStart)) << "its own reconnect";
  EXPECT_TRUE(workers.IsAnother(of("2"), kStart));
  EXPECT_TRUE(workers.IsAnother(of(""), kStart)) << "who does not tell takes over no name";
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart + seconds(1))) << "it is silent for too long";
  workers.Leave(1);
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart)) << "it has said that it leaves";
  workers.Connect(of("1"), 2, 0, kStart);
  EXPECT_TRUE(workers.IsAnother(of("2"), kStart));
  workers.Disconnect(2);
  EXPECT_FALSE(workers.IsAnother(of("2"), kStart)) << "killed, its stream is closed";
}

TEST(WorkerTable, OfVeryManyTheOneLongestGoneIsForgotten) {
  constexpr int kMany = 5000;
  WorkerTable workers;
  workers.Connect(Hello("there", 1), 1, 0, kStart);
  for (int k = 0; k < kMany; ++k) {
    const std::int64_t session = k + 2;
    v1::Hello hello = Hello(std::to_string(k), 1);
    hello.add_attempts(1);
    workers.Connect(hello, session, 0, kStart + seconds(k));
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
  workers.Connect(Hello("a", 1), 1, 0, kStart);
  workers.Drain("a");
  workers.Connect(Hello("a", 1), 2, 0, kStart);
  EXPECT_TRUE(workers.Find("a")->draining) << "a lost connection does not end a drain";
  workers.Leave(2);
  workers.Connect(Hello("a", 1), 3, 0, kStart);
  EXPECT_FALSE(workers.Find("a")->draining);
}

TEST(WorkerTable, GoneWorkersAreForgottenAfterAWhile) {
  WorkerTable workers;
  workers.Connect(Hello("a", 1), 1, 0, kStart);
  workers.Review(kStart, kStart + seconds(1));
  EXPECT_NE(workers.Find("a"), nullptr) << "it is connected";
  workers.Disconnect(1);
  workers.Review(kStart, kStart + seconds(1));
  EXPECT_EQ(workers.Find("a"), nullptr);
}

}  // namespace
}  // namespace calib::scheduler
