// What a run needs of its worker: threads and memory.
#include <gtest/gtest.h>

#include "server/messages/attempt_spec.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using Kind = v1::ServerMessage::MessageCase;

constexpr double kGigabyte = 1e9;

class Resources : public ::testing::Test {
 protected:
  static void Submit(SimulatedService& service, const std::string& resources,
                     const std::string& owner = "ann", int samples = 20) {
    service.owner = owner;
    service.Submit(testing::MakeSmallCampaign(
        {.samples = samples,
         .max_iterations = 1,
         .extra = resources.empty() ? "" : "resources: " + resources + "\n"}));
  }
  static int Busy(SimulatedService& service, const std::string& worker) {
    for (const v1::WorkerInfo& info : service.scheduler().Workers()) {
      if (info.name() == worker) return info.busy();
    }
    return -1;
  }
  static std::vector<v1::Lease> Leases(SimulatedService& service, std::int64_t worker) {
    std::vector<v1::Lease> leases;
    while (true) {
      const v1::ServerMessage message = service.Next(worker, Kind::kLease);
      if (!message.has_lease()) return leases;
      leases.push_back(message.lease());
    }
  }
};

TEST_F(Resources, ARunHoldsTheSlotsWhoseThreadsItUses) {
  SimulatedService service("threads");
  Submit(service, "{threads: 2}");
  const auto leases = Leases(service, service.Connect("w", 5));
  ASSERT_EQ(leases.size(), 2U) << "one slot is too few for a third";
  EXPECT_EQ(leases[0].spec().threads(), 2);
  EXPECT_EQ(Busy(service, "w"), 4);
  EXPECT_EQ(service.scheduler().OwnerShares().front().held(), 4);
}

TEST_F(Resources, MemoryIsSharedOutLikeThreads) {
  SimulatedService service("memory");
  service.dress = [](v1::Hello& hello) { hello.set_memory(16 * kGigabyte); };
  Submit(service, "{memory: 5 GB}");
  const auto leases = Leases(service, service.Connect("w", 8));  // 2 GB a slot
  ASSERT_EQ(leases.size(), 2U) << "a third would have 1 GB too few";
  EXPECT_EQ(leases[0].limits().memory(), 5 * kGigabyte);
  EXPECT_EQ(leases[0].spec().threads(), 3) << "of the slots that it holds";
}

TEST_F(Resources, WithoutAWordARunHasASlot) {
  SimulatedService service("a_slot");
  service.dress = [](v1::Hello& hello) { hello.set_memory(16 * kGigabyte); };
  Submit(service, "");
  const auto leases = Leases(service, service.Connect("w", 8));
  ASSERT_EQ(leases.size(), 8U);
  EXPECT_EQ(leases[0].limits().memory(), 2 * kGigabyte);
  EXPECT_EQ(leases[0].limits().silence(), campaign::kLongestSilence);
  EXPECT_FALSE(leases[0].limits().has_wall());
}

TEST_F(Resources, OfAWorkerThatDoesNotTellItsMemoryAnyMayBeWanted) {
  SimulatedService service("silent_on_memory");
  Submit(service, "{memory: 500 GB, wall: 2 h, silence: 10 min}");
  const auto leases = Leases(service, service.Connect("w", 2));
  ASSERT_EQ(leases.size(), 2U);
  EXPECT_EQ(leases[0].limits().memory(), 500 * kGigabyte) << "it is still its limit";
  EXPECT_EQ(leases[0].limits().wall(), 7200);
  EXPECT_EQ(leases[0].limits().silence(), 600);
}

TEST_F(Resources, WhatNoWorkerHasIsSaid) {
  SimulatedService service("too_much");
  service.dress = [](v1::Hello& hello) { hello.set_memory(4 * kGigabyte); };
  Submit(service, "{threads: 3, memory: 6 GB}");
  const std::int64_t worker = service.Connect("w", 4);
  EXPECT_TRUE(Leases(service, worker).empty());
  EXPECT_EQ(service.scheduler().Live(1)->nobody_may,
            "none of 1 connected workers has the 3 threads and 6000 MB that a run needs "
            "(resources): `calibctl workers` lists what they have");
  service.dress = [](v1::Hello& hello) { hello.set_memory(8 * kGigabyte); };
  EXPECT_EQ(Leases(service, service.Connect("v", 4)).size(), 1U);
  EXPECT_EQ(service.scheduler().Live(1)->nobody_may, "");
}

// Smaller runs take no slot of the worker that is to have as many as the larger one needs.
TEST_F(Resources, ALargeRunIsNotKeptWaitingBySmallOnes) {
  SimulatedService service("large");
  Submit(service, "", "ann");
  const std::int64_t worker = service.Connect("w", 4);
  std::vector<v1::Lease> small = Leases(service, worker);
  ASSERT_EQ(small.size(), 4U);
  Submit(service, "{threads: 3}", "bob", 8);
  for (int k = 0; k < 3; ++k) {
    const v1::Lease& lease = small[static_cast<std::size_t>(k)];
    service.SendStates(worker, lease, 0, 4);
    service.SendEnd(worker, lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  }
  const auto leases = Leases(service, worker);
  ASSERT_EQ(leases.size(), 1U);
  EXPECT_EQ(leases.front().spec().threads(), 3);
  EXPECT_EQ(Busy(service, "w"), 4);
}

TEST_F(Resources, AQuotaIsSavedForTheNextRunOfItsOwner) {
  SimulatedService service("saved");
  Submit(service, "");
  const std::int64_t worker = service.Connect("w", 8);
  service.scheduler().SetQuota("ann", 3, [](const absl::Status& /*status*/) {});
  service.ports().Run();
  std::vector<v1::Lease> small = Leases(service, worker);
  ASSERT_EQ(small.size(), 8U) << "what runs goes on";
  Submit(service, "{threads: 3}", "ann", 8);
  for (std::size_t k = 0; k < small.size(); ++k) {
    EXPECT_TRUE(Leases(service, worker).empty()) << k;
    service.SendStates(worker, small[k], 0, 4);
    service.SendEnd(worker, small[k].attempt(), v1::Finished::OUTCOME_COMPLETED);
  }
  const auto leases = Leases(service, worker);
  ASSERT_EQ(leases.size(), 1U);
  EXPECT_EQ(leases.front().spec().threads(), 3);
}

TEST_F(Resources, AfterARestartARunHoldsItsSlotsAgain) {
  SimulatedService service("large_again");
  Submit(service, "{threads: 3}");
  const std::int64_t worker = service.Connect("w", 4);
  const auto leases = Leases(service, worker);
  ASSERT_EQ(leases.size(), 1U);
  service.Restart();
  EXPECT_TRUE(Leases(service, service.Connect("w", 4, {leases.front().attempt()})).empty());
  EXPECT_EQ(Busy(service, "w"), 3);
  EXPECT_EQ(service.scheduler().OwnerShares().front().held(), 3);
}

TEST_F(Resources, ChangeNoBit) {
  SimulatedService plain("plain");
  Submit(plain, "");
  plain.RunToEnd(1, true);
  SimulatedService wide("wide");
  Submit(wide, "{threads: 2, memory: 1 GB}");
  wide.RunToEnd(3, false);
  EXPECT_TRUE(wide.Fingerprint() == plain.Fingerprint());
}

}  // namespace
}  // namespace calib::scheduler
