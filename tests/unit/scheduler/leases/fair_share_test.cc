// Many people, one server: who gets the next free slot.
#include "server/scheduler/leases/fair_share.h"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using Kind = v1::ServerMessage::MessageCase;

FairLine::Place PlaceOf(const std::string& owner, std::int64_t campaign, int priority = 0) {
  return {.first = {.campaign = campaign, .sample = 0, .experiment = 0},
          .group = {campaign, ""},
          .owner = owner,
          .priority = priority};
}

/// Grants to whoever comes first, without an end of any run.
class Grants {
 public:
  explicit Grants(std::vector<FairLine::Place> places) : places_(std::move(places)) {}

  /// Campaigns in the order in which they are served.
  std::vector<std::int64_t> Next(int count) {
    FairLine line(shares_);
    for (const FairLine::Place& place : places_) line.Enter(place);
    std::vector<std::int64_t> served;
    for (int i = 0; i < count; ++i) {
      const FairLine::Place place = line.Take();
      served.push_back(place.first.campaign);
      shares_.Take({.owner = place.owner, .campaign = served.back(), .attempt = ++attempt_});
      line.Served(place.owner, served.back());
      line.Enter(place);
    }
    return served;
  }
  Shares& shares() { return shares_; }

 private:
  const std::vector<FairLine::Place> places_;
  Shares shares_;
  std::int64_t attempt_ = 0;
};

using Campaigns = std::vector<std::int64_t>;

TEST(FairShare, OwnersAreServedByTurnsHoweverManyCampaignsTheyHave) {
  Grants grants({PlaceOf("ann", 1), PlaceOf("ann", 2), PlaceOf("ann", 3), PlaceOf("bob", 4)});
  EXPECT_EQ(grants.Next(8), (Campaigns{1, 4, 2, 4, 3, 4, 1, 4}));
  EXPECT_EQ(grants.shares().OfOwner("ann").held, 4);
  EXPECT_EQ(grants.shares().OfOwner("bob").held, 4);
}

TEST(FairShare, WhoHoldsFewestComesFirst) {
  Grants grants({PlaceOf("ann", 1), PlaceOf("bob", 2)});
  grants.shares().Take({.owner = "ann", .campaign = 9, .attempt = 1, .slots = 3});
  EXPECT_EQ(grants.Next(5), (Campaigns{2, 2, 2, 1, 2})) << "level, the one served longest ago";
}

TEST(FairShare, OfASingleSlotTwoOwnersHaveEveryOther) {
  Grants grants({PlaceOf("ann", 1), PlaceOf("bob", 2)});
  Campaigns served;
  for (int i = 0; i < 4; ++i) {
    const std::int64_t one = grants.Next(1).front();
    served.push_back(one);
    grants.shares().Return({.owner = one == 1 ? "ann" : "bob", .campaign = one, .attempt = i + 1});
  }
  EXPECT_EQ(served, (Campaigns{1, 2, 1, 2}));
}

TEST(FairShare, PriorityOrdersTheCampaignsOfOneOwnerAlone) {
  Grants grants({PlaceOf("ann", 1), PlaceOf("ann", 2, 100), PlaceOf("bob", 3, -100)});
  EXPECT_EQ(grants.Next(6), (Campaigns{2, 3, 2, 3, 2, 3}));
}

TEST(FairShare, AmongManyAGrantTakesLittle) {
  std::vector<FairLine::Place> places;
  for (int k = 0; k < 1000; ++k) places.push_back(PlaceOf("o" + std::to_string(k % 50), k + 1));
  Grants grants(places);
  grants.Next(50'000);  // far beyond a test's time if one looked at all campaigns each time
  for (int k = 0; k < 50; ++k) {
    EXPECT_EQ(grants.shares().OfOwner("o" + std::to_string(k)).held, 1000);
  }
}

TEST(FairShare, AQuotaLeavesWhatIsNotHeld) {
  Shares shares;
  shares.SetQuota("ann", 2);
  EXPECT_EQ(shares.Left("ann"), 2);
  shares.Take({.owner = "ann", .campaign = 1, .attempt = 1, .slots = 3});  // before the quota
  EXPECT_EQ(shares.Left("ann"), 0);
  shares.Return({.owner = "ann", .campaign = 1, .attempt = 1, .slots = 3});
  EXPECT_EQ(shares.Left("ann"), 2);
  shares.SetQuota("ann", std::nullopt);
  EXPECT_GT(shares.Left("ann"), 1000);
  EXPECT_TRUE(shares.Owners().empty());
}

// ---- the scheduler ----

// Campaigns of different seeds, so that no run is another's.
class ManyPeople : public ::testing::Test {
 protected:
  std::string Submit(SimulatedService& service, const std::string& owner, int seed,
                     const std::string& extra = "") const {
    testing::SmallCampaign campaign =
        testing::MakeSmallCampaign({.samples = 20, .max_iterations = 1, .extra = extra});
    const std::size_t at = campaign.yaml.find("seed:");
    EXPECT_NE(at, std::string::npos);
    campaign.yaml.replace(at, campaign.yaml.find('\n', at) - at, "seed: " + std::to_string(seed));
    service.owner = owner;
    return service.Submit(campaign);
  }
  /// Runs by campaign.
  std::map<std::string, int> Running(SimulatedService& service) const {
    std::map<std::string, int> count;
    for (const v1::WorkerInfo& info : service.scheduler().Workers()) {
      for (const std::string& running : info.running()) {
        ++count[running.substr(0, running.find('/'))];
      }
    }
    return count;
  }
  void SetPriority(SimulatedService& service, std::int64_t campaign, int priority) const {
    service.scheduler().SetPriority(
        {.campaign = campaign, .priority = priority}, nullptr,
        [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; });
    service.ports().Run();
  }
  void SetQuota(SimulatedService& service, const std::string& owner,
                std::optional<int> slots) const {
    service.scheduler().SetQuota(
        owner, slots, [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; });
    service.ports().Run();
  }
};

TEST_F(ManyPeople, ShareANodeEquallyHoweverManyCampaignsTheyHave) {
  SimulatedService service("people");
  for (int seed = 1; seed <= 3; ++seed) Submit(service, "ann", seed);
  Submit(service, "bob", 4);
  service.Connect("w", 12);
  EXPECT_EQ(Running(service),
            (std::map<std::string, int>{{"c1", 2}, {"c2", 2}, {"c3", 2}, {"c4", 6}}));
}

TEST_F(ManyPeople, PriorityIsDurableAndTakesNothingFromOthers) {
  SimulatedService service("priorities");
  Submit(service, "ann", 1);
  Submit(service, "ann", 2);
  Submit(service, "bob", 3);
  SetPriority(service, 2, 7);
  service.Restart();
  EXPECT_EQ(Value(service.Read().Campaign(2)).priority, 7);
  service.Connect("w", 8);
  EXPECT_EQ(Running(service), (std::map<std::string, int>{{"c2", 4}, {"c3", 4}}));
}

TEST_F(ManyPeople, AQuotaBoundsWhatAnOwnerHoldsAcrossARestartUntilItIsTakenAway) {
  SimulatedService service("quotas");
  Submit(service, "ann", 1);
  SetQuota(service, "ann", 3);
  service.Restart();
  service.Connect("w", 8);
  EXPECT_EQ(Running(service), (std::map<std::string, int>{{"c1", 3}}));
  Submit(service, "bob", 2);
  EXPECT_EQ(Running(service), (std::map<std::string, int>{{"c1", 3}, {"c2", 5}}));
  const auto shares = service.scheduler().OwnerShares();
  ASSERT_EQ(shares.size(), 2U);
  EXPECT_EQ(shares[0].owner(), "ann");
  EXPECT_EQ(shares[0].slots(), 3);
  EXPECT_EQ(shares[0].held(), 3);
  EXPECT_EQ(shares[1].held(), 5);
  EXPECT_FALSE(shares[1].has_slots());
  service.Connect("v", 2);
  EXPECT_EQ(Running(service)["c1"], 3);
  SetQuota(service, "ann", std::nullopt);
  EXPECT_EQ(Running(service)["c2"], 7);
  service.Connect("u", 2);
  EXPECT_EQ(Running(service)["c1"], 5);
}

TEST_F(ManyPeople, AQuotaThatNoRunFitsSaysSo) {
  SimulatedService service("no_quota");
  Submit(service, "ann", 1);
  service.Connect("w", 2);
  SetQuota(service, "ann", 0);
  EXPECT_EQ(service.scheduler().Live(1)->nobody_may,
            "the quota of ann is 0 slots, and a run holds 1");
  SetQuota(service, "ann", 1);
  EXPECT_EQ(service.scheduler().Live(1)->nobody_may, "");
}

TEST_F(ManyPeople, WhoseTurnItIsChangesNoBit) {
  SimulatedService alone("alone");
  Submit(alone, "ann", 1);
  alone.RunToEnd(1, true);
  SimulatedService service("beside_others");
  Submit(service, "ann", 1);
  Submit(service, "ann", 2);
  Submit(service, "bob", 3);
  SetPriority(service, 2, 5);
  SetQuota(service, "ann", 2);
  service.RunToEnd(2, false);
  EXPECT_TRUE(service.Runs(1) == alone.Runs(1));
}

TEST_F(ManyPeople, LostNodesAndFailuresOfTheModelAreCountedApart) {
  constexpr int kAttempts = 5;  // failure.attempts of the campaign
  SimulatedService service("counted_apart");
  Submit(service, "ann", 1);
  const auto fail = [&](v1::Finished::Outcome outcome) {
    const std::int64_t worker = service.Connect("w", 1);
    const v1::Lease lease = service.Next(worker, Kind::kLease).lease();
    service.SendEnd(worker, lease.attempt(), outcome, "no reason");
    service.scheduler().Receive(worker, v1::Leaving());
    service.ports().Run();
  };
  for (int k = 1; k < kAttempts; ++k) fail(v1::Finished::OUTCOME_MODEL_FAILED);
  for (int k = 1; k < kAttempts; ++k) fail(v1::Finished::OUTCOME_FAILED);
  service.Restart();
  const auto first = Value(service.Read().Evaluations(1)).front();
  EXPECT_EQ(first.failures, kAttempts - 1);
  EXPECT_GE(first.losses, kAttempts - 1) << "and a restart forgets none of them";
  EXPECT_EQ(first.status, store::EvaluationStatus::kWaiting);
  fail(v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_EQ(Value(service.Read().Evaluations(1)).front().status, store::EvaluationStatus::kUnknown);
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kRunning)
      << "one alone pauses nothing";
}

}  // namespace
}  // namespace calib::scheduler
