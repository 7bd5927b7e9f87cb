#include "server/planning/rungs.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

constexpr int kRungSamples = 40;
constexpr int kLoadSteps = 12;

testing::SmallCampaign Campaign(const std::string& stopping, const std::string& method,
                                double noise = 0.02, const std::string& inference = "") {
  return testing::MakeSmallCampaign({.samples = kRungSamples,
                                     .max_iterations = method == "sqmc" ? 1 : 2,
                                     .load_steps = kLoadSteps,
                                     .failure_attempts = 100,
                                     .relative_noise = noise,
                                     .method = method,
                                     .inference = "  replicates: 0\n" + inference,
                                     .extra = "early_stopping: {" + stopping + "}\n"});
}

/// Nothing may be lost and no weight is as small as that, so that every sample goes on from every
/// rung.
constexpr double kMildNoise = 0.3;
constexpr const char* kNoLoss = "discard_at_most: 1e-300";
constexpr const char* kNoLossAtRungs = "discard_at_most: 1e-300, rungs: [0.25, 0.5, 0.8]";
/// Guiding weights of which a tenth is effective: fewer scouts, tighter bounds.
constexpr const char* kSharp = "  ess_target: 0.1\n";
constexpr const char* kAtRungs = "discard_at_most: 1e-3, rungs: [0.25, 0.5, 0.8]";

TEST(Rungs, SameBitsAsDepthFirstWhereNothingMayBeLost) {
  for (const std::string method : {"sqmc", "iterative_bayesian_filter"}) {
    SimulatedService depth("depth_first");
    depth.Submit(Campaign(kNoLoss, method, kMildNoise));
    depth.RunToEnd(1, true);
    SimulatedService breadth("breadth_first");
    breadth.Submit(Campaign(kNoLossAtRungs, method, kMildNoise));
    breadth.RunToEnd(1, true);
    EXPECT_TRUE(breadth.Fingerprint() == depth.Fingerprint()) << method;
    EXPECT_EQ(breadth.computed, depth.computed) << "a checkpoint leaves nothing to be run twice";
    SimulatedService storm("breadth_first_storm");
    storm.Submit(Campaign(kNoLossAtRungs, method, kMildNoise));
    storm.RunToEnd(2, false);
    EXPECT_TRUE(storm.Fingerprint() == depth.Fingerprint()) << method;
  }
}

TEST(Rungs, SaveLoadStepsOfTheFirstIterationWithinTheStatedLoss) {
  SimulatedService depth("depth_saving");
  depth.Submit(Campaign("discard_at_most: 1e-3", "sqmc", 0.02, kSharp));
  depth.RunToEnd(1, true);
  EXPECT_EQ(depth.computed, kRungSamples * kLoadSteps) << "nothing to compare with";
  const auto full = Value(depth.Read().Samples(1));
  struct Setting {
    std::string stopping;
    double least;  // saved
  };
  const Setting settings[] = {{.stopping = kAtRungs, .least = 0.1},  // found: 0.14, 0.58
                              {.stopping = std::string(kAtRungs) + ", exponent: 1", .least = 0.5}};
  for (const Setting& setting : settings) {
    SCOPED_TRACE(setting.stopping);
    SimulatedService breadth("breadth_saving");
    breadth.Submit(Campaign(setting.stopping, "sqmc", 0.02, kSharp));
    breadth.RunToEnd(1, true);
    const v1::Posterior with = LastPosterior(breadth);
    EXPECT_GT(with.stopped_early(), 0);
    EXPECT_LE(with.stated_loss(), 1e-3);
    EXPECT_GT(1 - static_cast<double>(breadth.computed) / depth.computed, setting.least);
    // The weights of the same samples differ by no more than was stated.
    const auto part = Value(breadth.Read().Samples(1));
    ASSERT_EQ(full.size(), part.size());
    double variation = 0;
    for (std::size_t i = 0; i < full.size(); ++i) {
      ASSERT_EQ(full[i].parameters, part[i].parameters);
      variation += 0.5 * std::abs(std::exp(full[i].log_weight) - std::exp(part[i].log_weight));
    }
    EXPECT_LE(variation, with.stated_loss());
  }
}

TEST(Rungs, SameBitsWhateverGoesWrong) {
  SimulatedService calm("rungs_calm");
  calm.Submit(Campaign(kAtRungs, "iterative_bayesian_filter"));
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService service("rungs_storm");
    service.Submit(Campaign(kAtRungs, "iterative_bayesian_filter"));
    service.RunToEnd(seed, false);
    EXPECT_TRUE(service.Fingerprint() == expected) << "seed " << seed;
  }
}

// What another campaign has run to its end would not rest, and change what goes on.
TEST(Rungs, SameBitsWhateverTheFolderHolds) {
  const testing::SmallCampaign campaign = Campaign(kAtRungs, "iterative_bayesian_filter");
  SimulatedService service("rungs_after_another");
  service.Submit(Campaign("discard_at_most: 1e-3", "iterative_bayesian_filter"));
  service.RunToEnd(1, true);
  service.Submit(campaign);
  service.RunToEnd(1, true);
  SimulatedService alone("rungs_alone");
  alone.Submit(campaign);
  alone.RunToEnd(1, true);
  const auto expected = Value(alone.Read().Samples(1));
  const auto samples = Value(service.Read().Samples(2));
  ASSERT_EQ(samples.size(), expected.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].parameters, expected[i].parameters);
    EXPECT_EQ(samples[i].log_weight, expected[i].log_weight);
  }
}

TEST(Rungs, ARestingRunGoesOnWhereItsCheckpointIs) {
  SimulatedService service("rungs_home");
  service.Submit(Campaign(kAtRungs, "sqmc"));
  // One worker brings all samples to the first rung.
  const std::int64_t home = service.Connect("home", 1);
  std::string run;
  for (int i = 0; i < kRungSamples; ++i) {
    const v1::Lease lease = service.Next(home, v1::ServerMessage::kLease).lease();
    ASSERT_TRUE(lease.has_rest_after());
    EXPECT_EQ(lease.rest_after(), 2) << "three of twelve load steps";
    if (i == kRungSamples - 1) service.Connect("other", 2);
    service.SendStates(home, lease, 0, 3);
    service.SendEnd(home, lease.attempt(), v1::Finished::OUTCOME_RESTING);
  }
  // Scouts go on, one at a time: the other worker has nothing to go on from.
  const v1::Lease scout = service.Next(home, v1::ServerMessage::kLease).lease();
  EXPECT_FALSE(scout.has_rest_after());
  EXPECT_FALSE(scout.run().empty());
  const auto workers = service.scheduler().Workers();
  ASSERT_EQ(workers.size(), 2U);
  EXPECT_EQ(workers[0].busy(), 1);
  EXPECT_EQ(workers[1].busy(), 0);
  // Where the folder is gone, whoever is there begins anew.
  service.Advance(std::chrono::milliseconds(1100));
  const std::int64_t again = service.Connect("other", 2);
  EXPECT_NE(service.Next(again, v1::ServerMessage::kLease).lease().attempt(), 0);
}

TEST(Rungs, StatesBehindTheRungAreRefused) {
  SimulatedService service("rungs_beyond");
  service.Submit(Campaign(kAtRungs, "sqmc"));
  const std::int64_t worker = service.Connect("eager", 1);
  const v1::Lease lease = service.Next(worker, v1::ServerMessage::kLease).lease();
  service.SendStates(worker, lease, 0, 4);
  EXPECT_TRUE(service.Next(worker, v1::ServerMessage::kAck).ack().refused());
  EXPECT_TRUE(service.Read().States(1)->empty());
}

}  // namespace
}  // namespace calib::scheduler
