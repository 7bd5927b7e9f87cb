// adaptive_emulator through the scheduler: what it runs, when it ends, and that its bits are the
// same whatever goes wrong. Its numbers are held by tests/verification/inference/adaptive.
#include <gmock/gmock.h>

#include <set>

#include "absl/strings/str_format.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;

testing::SmallCampaign AdaptiveCampaignOf(const std::string& inference, int packings = 1) {
  return testing::MakeSmallCampaign({.samples = 0,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.02,
                                     .packings = packings,
                                     .method = "adaptive_emulator",
                                     .inference = inference});
}

v1::Posterior PosteriorAtTheEnd(SimulatedService& service) {
  v1::Posterior last;
  for (const store::IterationRecord& iteration : Value(service.Read().Iterations(1))) {
    if (iteration.posterior.has_value()) last = *planning::PosteriorFromJson(*iteration.posterior);
  }
  return last;
}

TEST(AdaptiveCampaign, PlacesBatchesUntilThePosteriorIsKnown) {
  SimulatedService service("adaptive");
  service.Submit(AdaptiveCampaignOf("  max_runs: 80\n"));
  service.RunToEnd(1, true);
  const auto progress = Value(service.Read().Campaign(1)).progress;
  EXPECT_EQ(progress.state, store::CampaignState::kFinished) << progress.reason;
  EXPECT_TRUE(progress.converged) << PosteriorAtTheEnd(service).warnings(0);
  const v1::Posterior posterior = PosteriorAtTheEnd(service);
  EXPECT_EQ(posterior.posterior_from(), "emulator");
  ASSERT_GE(posterior.batches_size(), 4) << "first, two that settle, one that judges";
  EXPECT_EQ(posterior.batches(0).runs(), 20) << "ten for each parameter";
  int runs = 0;
  for (const auto& batch : posterior.batches()) {
    runs += batch.runs();
    EXPECT_GE(batch.expected_gain(), 0);
    EXPECT_LE(batch.expected_gain(), 1);
  }
  EXPECT_LE(runs, 80);
  EXPECT_GT(posterior.batches(1).expected_gain(), posterior.batches(3).expected_gain());
  double best = -std::numeric_limits<double>::infinity();
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    best = std::max(best, sample.log_likelihood);
  }
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    EXPECT_EQ(sample.log_weight == 0, sample.log_likelihood == best) << "the best run alone";
  }
  for (const auto& parameter : posterior.parameters()) EXPECT_GT(parameter.sd(), 0);
}

TEST(AdaptiveCampaign, SpreadsItsRunsOverThePackings) {
  SimulatedService service("adaptive_packings");
  service.Submit(AdaptiveCampaignOf("  max_runs: 60\n  batch: 4\n", 4));
  service.RunToEnd(1, true);
  std::vector<int> runs(4, 0);
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    ASSERT_TRUE(sample.stream.has_value());
    ++runs[static_cast<std::size_t>(*sample.stream % 4)];
  }
  const auto [fewest, most] = std::minmax_element(runs.begin(), runs.end());
  EXPECT_LE(*most - *fewest, 4) << "the repeats of the first batch apart they are balanced";
}

TEST(AdaptiveCampaign, SameBitsWhateverGoesWrong) {
  const auto campaign = AdaptiveCampaignOf("  max_runs: 44\n");
  SimulatedService calm("adaptive_calm");
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService storm("adaptive_storm");
    storm.Submit(campaign);
    storm.RunToEnd(seed, false);
    EXPECT_EQ(storm.Fingerprint(), calm.Fingerprint()) << seed;
  }
}

TEST(AsynchronousAdaptiveCampaign, ABudgetEndsItAtTheSameBatchWhoeverWorks) {
  // Of 32 runs the first batch and two others are made; a third would exceed them.
  const auto campaign =
      testing::MakeSmallCampaign({.samples = 0,
                                  .load_steps = 12,
                                  .relative_noise = 0.02,
                                  .with_second = true,
                                  .method = "adaptive_emulator",
                                  .inference = "  max_runs: 56\n  asynchronous: true\n",
                                  .extra = "budget: {model_evaluations: 74}\n"});
  std::string first;
  for (const int workers : {1, 3, 40}) {
    SimulatedService service("asynchronous_budget");
    service.Submit(campaign);
    service.RunTimed(workers, [](int evaluation) { return 1.0 + (evaluation * 7) % 5; });
    const auto samples = Value(service.Read().Samples(1));
    EXPECT_EQ(samples.size(), 32U);
    const v1::Posterior posterior = PosteriorAtTheEnd(service);
    EXPECT_THAT(posterior.warnings(),
                ::testing::Contains(HasSubstr("the budget allows no further batch of 6 runs")));
    if (first.empty()) first = service.Fingerprint();
    EXPECT_EQ(service.Fingerprint(), first) << workers << " workers";
  }
}

constexpr const char* kAsynchronous = "  max_runs: 56\n  asynchronous: true\n";

TEST(AsynchronousAdaptiveCampaign, HasTheNextBatchUnderWayBeforeOneHasEnded) {
  // Of every batch one run takes twenty times as long as the others.
  const auto seconds = [](int evaluation) { return evaluation % 6 == 0 ? 20.0 : 1.0; };
  const auto busy = [&seconds](const std::string& name, const std::string& inference) {
    SimulatedService service(name);
    service.Submit(AdaptiveCampaignOf(inference));
    const SimulatedService::Shift shift = service.RunTimed(6, seconds);
    EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished);
    EXPECT_EQ(PosteriorAtTheEnd(service).posterior_from(), "emulator");
    return shift.computing / (6 * shift.elapsed);
  };
  const double alone = busy("adaptive_waits", "  max_runs: 56\n");
  const double overlapping = busy("adaptive_overlaps", kAsynchronous);
  EXPECT_GT(overlapping, 1.2 * alone);
}

TEST(AsynchronousAdaptiveCampaign, SameBitsWhateverGoesWrongAndWhoeverWorks) {
  const auto campaign = AdaptiveCampaignOf(kAsynchronous, 4);
  SimulatedService calm("asynchronous_calm");
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  EXPECT_EQ(calm.Campaign().progress.state, store::CampaignState::kFinished);
  for (const int workers : {1, 40}) {
    SimulatedService timed("asynchronous_timed");
    timed.Submit(campaign);
    timed.RunTimed(workers, [](int evaluation) { return 1.0 + (evaluation * 7) % 5; });
    EXPECT_EQ(timed.Fingerprint(), calm.Fingerprint()) << workers << " workers";
  }
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService storm("asynchronous_storm");
    storm.Submit(campaign);
    storm.RunToEnd(seed, false);
    EXPECT_EQ(storm.Fingerprint(), calm.Fingerprint()) << seed;
  }
}

// The finished runs of a campaign as rows of another.
std::string RowsOf(SimulatedService& service, std::int64_t campaign, std::size_t most) {
  std::string rows = "  rows:\n";
  const auto samples = Value(service.Read().Samples(campaign));
  for (std::size_t i = 0; i < std::min(most, samples.size()); ++i) {
    absl::StrAppendFormat(&rows, "    - {like: %d, young_modulus: %.17g, friction_angle: %.17g}\n",
                          samples[i].stream.value_or(samples[i].sample), samples[i].parameters[0],
                          samples[i].parameters[1]);
  }
  return rows;
}

TEST(AdaptiveCampaign, StartsFromTheRunsOfAnotherWithoutMakingThemAgain) {
  SimulatedService service("adaptive_rows");
  service.Submit(AdaptiveCampaignOf("  max_runs: 38\n", 4));
  service.RunToEnd(1, true);
  const auto first = Value(service.Read().Samples(1));
  service.Submit(AdaptiveCampaignOf("  max_runs: 60\n" + RowsOf(service, 1, first.size()), 4));
  service.RunToEnd(2, true);
  const auto record = Value(service.Read().Campaign(2));
  ASSERT_EQ(record.progress.state, store::CampaignState::kFinished) << record.progress.reason;
  int reused = 0, made = 0;
  for (const auto& evaluation : Value(service.Read().Evaluations(2))) {
    (evaluation.reused ? reused : made) += 1;
  }
  EXPECT_EQ(reused, static_cast<int>(first.size()));
  const auto samples = Value(service.Read().Samples(2));
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(samples[i].parameters, first[i].parameters);
    EXPECT_EQ(samples[i].stream, first[i].stream);
  }
  // All points that fill the prior are there: four repeats are added to them.
  int begun = 0;
  std::set<int> streams;
  for (const auto& sample : samples) {
    begun += sample.iteration == 0 ? 1 : 0;
    streams.insert(*sample.stream);
  }
  EXPECT_EQ(begun, static_cast<int>(first.size()) + 4);
  EXPECT_EQ(streams.size(), samples.size()) << "each run is one of its own";
  EXPECT_LT(made, 60);
}

std::string FirstProblemOf(const testing::SmallCampaign& c) {
  const auto read = [&c](const std::string& path) -> absl::StatusOr<std::string> {
    const auto found = c.files.find(path);
    return found != c.files.end() ? absl::StatusOr<std::string>(found->second)
                                  : absl::NotFoundError(path);
  };
  const auto outcome = campaign::ReadCampaign(methods::All(), c.yaml, "c.yaml", read);
  return outcome.problems.empty() ? "" : campaign::ToString(outcome.problems.front());
}

TEST(AdaptiveCampaign, BadInputIsOneSentence) {
  EXPECT_EQ(FirstProblemOf(AdaptiveCampaignOf("  batch: auto\n")), "");
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf("  max_runs: 20\n")),
              HasSubstr("max_runs: is 20, and 2 parameters take 38 runs at least: 20 that fill the "
                        "prior, two batches of 6 and 6 that judge"));
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf("  samples: 50\n")),
              HasSubstr("samples: is chosen by adaptive_emulator; max_runs bounds its runs"));
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf("  batch: many\n")), HasSubstr("batch: "));
  EXPECT_EQ(FirstProblemOf(AdaptiveCampaignOf("  asynchronous: true\n")), "");
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf(
                  "  rows:\n    - {young_modulus: 1e8, friction_angle: 2000}\n")),
              HasSubstr("friction_angle = 2000 lies outside the prior"));
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf(
                  "  rows:\n    - {like: 4, young_modulus: 1e8, friction_angle: 0.4}\n"
                  "    - {like: 4, young_modulus: 1e8, friction_angle: 0.4}\n")),
              HasSubstr("rows: [1] is [0] once more: the same run"));
  EXPECT_THAT(FirstProblemOf(AdaptiveCampaignOf("  asynchronous: often\n")),
              HasSubstr("asynchronous: "));
  auto inferred = AdaptiveCampaignOf("");
  inferred.yaml.replace(inferred.yaml.find("noise: given"), 12, "noise: inferred");
  EXPECT_THAT(FirstProblemOf(inferred), HasSubstr("needs the errors of the readings as they are"));
}

}  // namespace
}  // namespace calib::scheduler
