// Builds that differ: what a worker of another one gets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/calib/v1/protocol.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;
using Kind = v1::ServerMessage::MessageCase;

void OfAnotherBuild(v1::Hello& hello) { hello.set_engine_version("0"); }

v1::WorkerInfo Only(SimulatedService& service) {
  const auto workers = service.scheduler().Workers();
  EXPECT_EQ(workers.size(), 1U);
  return workers.empty() ? v1::WorkerInfo() : workers.front();
}

TEST(Upgrades, AWorkerOfOtherMechanicsWaits) {
  SimulatedService service("other_mechanics");
  service.Submit(testing::MakeSmallCampaign({}));
  service.dress = OfAnotherBuild;
  const std::int64_t worker = service.Connect("w", 2);
  EXPECT_THAT(service.Next(worker, Kind::kWelcome).welcome().waits(), HasSubstr("mechanics"));
  EXPECT_FALSE(service.Next(worker, Kind::kLease).has_lease());
  EXPECT_THAT(Only(service).waits(), HasSubstr("version 0"));
  EXPECT_THAT(service.scheduler().Live(1)->nobody_may, HasSubstr("the server's mechanics"));
  service.dress = [](v1::Hello& hello) { hello.set_catalog_digest("another"); };
  EXPECT_FALSE(service.Next(service.Connect("w", 2), Kind::kLease).has_lease());
  EXPECT_THAT(Only(service).waits(), HasSubstr("other contacts"));
  service.dress = {};
  EXPECT_TRUE(service.Next(service.Connect("w", 2), Kind::kLease).has_lease());
  EXPECT_EQ(Only(service).waits(), "");
  EXPECT_EQ(service.scheduler().Live(1)->nobody_may, "");
}

// The server is of a newer build while its worker computes: what that holds has other bits.
TEST(Upgrades, WhatTheOtherBuildHoldsIsRunAnew) {
  SimulatedService undisturbed("upgrade_calm");
  undisturbed.Submit(testing::MakeSmallCampaign({}));
  undisturbed.RunToEnd(1, true);
  SimulatedService service("upgrade");
  service.Submit(testing::MakeSmallCampaign({}));
  const std::int64_t before = service.Connect("w", 2);
  const v1::Lease held = service.Next(before, Kind::kLease).lease();
  service.SendStates(before, held, 0, 2);
  service.Restart();
  service.dress = OfAnotherBuild;
  const std::int64_t after = service.Connect("w", 2, {held.attempt()});
  const v1::Ack ack = service.Next(after, Kind::kAck).ack();
  EXPECT_EQ(ack.attempt(), held.attempt());
  EXPECT_TRUE(ack.refused());
  EXPECT_EQ(Only(service).busy(), 0);
  service.dress = {};
  service.RunToEnd(2, true);
  EXPECT_TRUE(service.Fingerprint() == undisturbed.Fingerprint());
}

TEST(Upgrades, AWorkerFromBeforeProtocolsWereToldWorksOn) {
  SimulatedService service("no_protocol");
  service.Submit(testing::MakeSmallCampaign({.extra = "resources: {wall: 2 h}\n"}));
  service.dress = [](v1::Hello& hello) {
    hello.clear_protocol();
    hello.clear_features();
  };
  const std::int64_t worker = service.Connect("w", 2);
  EXPECT_FALSE(service.Next(worker, Kind::kLease).has_lease()) << "it would not end it in time";
  EXPECT_THAT(service.scheduler().Live(1)->nobody_may, HasSubstr("update the nodes"));
  service.Submit(testing::MakeSmallCampaign({}));
  EXPECT_TRUE(service.Next(worker, Kind::kLease).has_lease());
}

TEST(Upgrades, WhoeverSpeaksAnOlderProtocolIsTheOneToUpdate) {
  EXPECT_TRUE(CheckProtocol("worker w", 0, "the server").ok());
  EXPECT_TRUE(CheckProtocol("worker w", kProtocol + 5, "the server").ok()) << "it speaks ours too";
  EXPECT_EQ(CheckProtocol("worker w", 0, "the server", 2),
            absl::FailedPreconditionError(
                "worker w speaks protocol 1, the server from 2 on: update worker w"));
}

}  // namespace
}  // namespace calib::scheduler
