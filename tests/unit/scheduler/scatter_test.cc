// Realizations: the best estimate is run on every packing, and what the runs differ by joins the
// errors.
#include "server/planning/scatter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/methods/registry.h"
#include "server/planning/history.h"
#include "server/planning/posterior_record.h"
#include "server/service/queries.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kSamples = 60;

testing::SmallCampaign Campaign(int packings, const std::string& extra = "",
                                const std::string& inference = "") {
  return testing::MakeSmallCampaign({.samples = kSamples,
                                     .max_iterations = 2,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.02,
                                     .packings = packings,
                                     .with_validation = true,
                                     .inference = inference,
                                     .extra = extra});
}

struct Ended {
  v1::Posterior posterior;
  std::vector<store::IterationRecord> iterations;
  std::vector<store::SampleRecord> samples;
  std::int64_t evaluations = 0;
};

Ended RunCampaign(const std::string& name, const testing::SmallCampaign& campaign, double scatter,
                  unsigned seed = 1, bool calm = true) {
  SimulatedService service(name);
  service.packing_scatter = scatter;
  service.Submit(campaign);
  service.RunToEnd(seed, calm);
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished)
      << service.Campaign().progress.reason;
  Ended run{.posterior = {},
            .iterations = Value(service.Read().Iterations(1)),
            .samples = Value(service.Read().Samples(1)),
            .evaluations = Value(service.Read().EffortOf(1)).model_evaluations};
  for (const store::IterationRecord& iteration : run.iterations) {
    if (iteration.posterior.has_value())
      run.posterior = *planning::PosteriorFromJson(*iteration.posterior);
  }
  return run;
}

campaign::Campaign ReadCampaignOf(const testing::SmallCampaign& campaign) {
  campaign::ReadOutcome read = campaign::ReadCampaign(
      methods::All(), campaign.yaml, "c.yaml", [&campaign](const std::string& path) {
        const auto file = campaign.files.find(path);
        return file != campaign.files.end() ? absl::StatusOr<std::string>(file->second)
                                            : absl::NotFoundError(path);
      });
  EXPECT_TRUE(read.problems.empty());
  return std::move(read.campaign);
}

// On so many packings; scattered as their runs are, or as twins are.
void ExpectTroubleChangesNoBit(int packings) {
  const auto run = [packings](const char* name, unsigned seed, bool calm) {
    SimulatedService service(name);
    (packings > 1 ? service.packing_scatter : service.repeat_scatter) = 0.05;
    service.Submit(Campaign(packings));
    service.RunToEnd(seed, calm);
    return service.Fingerprint();
  };
  EXPECT_TRUE(run("scatter_storm", 5, false) == run("scatter_calm", 1, true));
}

// A scatter of sd one of every observable.
planning::MeasuredScatter Measured(const planning::Definition& definition, const char* from,
                                   int runs) {
  planning::MeasuredScatter measured;
  for (const auto& [group, readings] : inference::GroupsOf(definition.data)) {
    const auto n = static_cast<Eigen::Index>(readings.size());
    measured.observables.push_back({.group = {.experiment = group.first,
                                              .observable = group.second,
                                              .sd = Eigen::VectorXd::Ones(n),
                                              .clock = Eigen::VectorXd::LinSpaced(n, 0, 1),
                                              .length = 1,
                                              .share = 1},
                                    .from = from,
                                    .runs = runs});
  }
  EXPECT_FALSE(measured.observables.empty());
  return measured;
}

TEST(Realizations, ReplicatesAreMadeAsOftenAsTheCampaignSays) {
  const auto replicates_of = [](int replicates) {
    const std::string number = std::to_string(replicates);
    const Ended run = RunCampaign("replicates_" + number,
                                  Campaign(4, "", "  replicates: " + number + "\n"), 0.05);
    int count = 0;
    for (const store::IterationRecord& iteration : run.iterations) {
      if (iteration.proposal != planning::kReplicates) continue;
      for (const store::SampleRecord& sample : run.samples) {
        count += sample.iteration == iteration.number ? 1 : 0;
      }
    }
    return count;
  };
  EXPECT_EQ(replicates_of(0), 0);
  EXPECT_EQ(replicates_of(6), 6);
}

TEST(Realizations, BestEstimateRunsOnEveryPacking) {
  const Ended one = RunCampaign("scatter_one", Campaign(1), 0.05);
  const Ended four = RunCampaign("scatter_four", Campaign(4), 0.05);
  // Twins of this smooth model have not parted: what single runs scatter by is the emulator's to
  // say.
  ASSERT_EQ(one.posterior.scatter_size(), 1);
  EXPECT_EQ(one.posterior.scatter(0).from(), "emulator");
  const auto replicates =
      std::find_if(four.iterations.begin(), four.iterations.end(),
                   [](const auto& i) { return i.proposal == planning::kReplicates; });
  ASSERT_NE(replicates, four.iterations.end());
  EXPECT_FALSE(replicates->posterior.has_value());
  std::vector<const store::SampleRecord*> runs;
  for (const store::SampleRecord& sample : four.samples) {
    if (sample.iteration == replicates->number) runs.push_back(&sample);
  }
  ASSERT_EQ(runs.size(), 4U);
  for (const store::SampleRecord* run : runs) {
    EXPECT_EQ(run->parameters, runs.front()->parameters);
    EXPECT_EQ(run->log_weight, -INFINITY);
  }
  // One observable of the fitted test and one of the held-out test, the model's relative scatter in
  // both: digests of the four packings differ by about a uniform number on (-1, 1).
  ASSERT_EQ(four.posterior.scatter_size(), 2);
  for (const auto& scatter : four.posterior.scatter()) {
    EXPECT_EQ(scatter.from(), "realizations");
    EXPECT_EQ(scatter.runs(), 4);
    EXPECT_EQ(scatter.share(), 1);
    ASSERT_EQ(scatter.sd_size(), 12);
    EXPECT_GT(scatter.sd(11), 0.005);
    EXPECT_LT(scatter.sd(11), 0.3);
    EXPECT_GT(scatter.correlation_length(), 0.044);  // a run is off all along its path
  }
}

// One packing, run again and again with parameters that differ by a millionth.
TEST(Twins, OfTheBestEstimateOnTheOnlyPackingAreMadeAsOftenAsTheCampaignSays) {
  SimulatedService service("twins_twelve");
  service.repeat_scatter = 0.05;
  service.Submit(Campaign(1, "", "  replicates: 12\n"));
  service.RunToEnd(1, true);
  v1::Posterior posterior;
  std::vector<store::SampleRecord> repeats;
  for (const store::IterationRecord& iteration : Value(service.Read().Iterations(1))) {
    if (iteration.posterior) posterior = *planning::PosteriorFromJson(*iteration.posterior);
    if (iteration.proposal != planning::kReplicates) continue;
    for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
      if (sample.iteration == iteration.number) repeats.push_back(sample);
    }
  }
  ASSERT_EQ(repeats.size(), 12U);
  for (std::size_t i = 1; i < repeats.size(); ++i) {
    for (std::size_t j = 0; j < repeats[i].parameters.size(); ++j) {
      EXPECT_NE(repeats[i].parameters[j], repeats[i - 1].parameters[j]) << "a run of its own";
      EXPECT_NEAR(repeats[i].parameters[j] / repeats[0].parameters[j], 1, 1e-4);
    }
  }
  // sd of a uniform number on (-1, 1) is 0.58; the curve ends near 1 + 2 tan(friction).
  ASSERT_EQ(posterior.scatter_size(), 2);
  for (const auto& scatter : posterior.scatter()) {
    EXPECT_EQ(scatter.from(), "repeats");
    EXPECT_EQ(scatter.runs(), 12);
    ASSERT_EQ(scatter.sd_size(), 12);
    EXPECT_GT(scatter.sd(11), 0.02);
    EXPECT_LT(scatter.sd(11), 0.15);
  }
}

std::size_t TwinsOf(const Ended& run) {
  for (const store::IterationRecord& iteration : run.iterations) {
    if (iteration.proposal != planning::kReplicates) continue;
    return static_cast<std::size_t>(std::count_if(
        run.samples.begin(), run.samples.end(),
        [&iteration](const auto& sample) { return sample.iteration == iteration.number; }));
  }
  return 0;
}

bool LogHas(SimulatedService& service, const std::string& what) {
  const auto log = Value(service.Read().Events(1));
  return std::any_of(log.begin(), log.end(), [&what](const auto& event) {
    return event.what.find(what) != std::string::npos;
  });
}

TEST(Twins, OfTheBestEstimateAreEightWhereNothingIsSaid) {
  SimulatedService service("twins");
  service.repeat_scatter = 0.05;
  service.Submit(Campaign(1));
  service.RunToEnd(1, true);
  const v1::Posterior posterior = LastPosterior(service);
  ASSERT_EQ(posterior.scatter_size(), 2) << "the held-out test's among them";
  for (const auto& scatter : posterior.scatter()) {
    EXPECT_EQ(scatter.from(), "repeats");
    EXPECT_EQ(scatter.runs(), 8);
    EXPECT_GT(scatter.sd(11), 0.01);
  }
  EXPECT_TRUE(LogHas(service, "8 times with parameters that differ by a millionth, 16 model eval"));
  EXPECT_FALSE(LogHas(service, "the twins show no scatter"));
}

TEST(Twins, AreNotMadeWhereTheUserSaysNoneAndNeverMoreThanSamples) {
  EXPECT_EQ(TwinsOf(RunCampaign("no_twins", Campaign(1, "", "  replicates: 0\n"), 0)), 0U);
  testing::SmallCampaign few = testing::MakeSmallCampaign({.samples = 5, .max_iterations = 1});
  EXPECT_EQ(TwinsOf(RunCampaign("few_twins", few, 0)), 5U);
}

TEST(Twins, ThatHaveNotPartedCountAsNone) {
  SimulatedService smooth("smooth_twins");
  smooth.Submit(Campaign(1));
  smooth.RunToEnd(1, true);
  EXPECT_TRUE(LogHas(smooth, "the twins show no scatter"));
  const Ended none = RunCampaign("without_twins", Campaign(1, "", "  replicates: 0\n"), 0);
  // The same posterior, bit for bit.
  const v1::Posterior with = LastPosterior(smooth);
  ASSERT_EQ(with.parameters_size(), none.posterior.parameters_size());
  for (int j = 0; j < with.parameters_size(); ++j) {
    EXPECT_EQ(with.parameters(j).mean(), none.posterior.parameters(j).mean());
    EXPECT_EQ(with.parameters(j).sd(), none.posterior.parameters(j).sd());
  }
  EXPECT_EQ(with.log_evidence(), none.posterior.log_evidence());
}

TEST(Twins, BudgetAllows) {
  SimulatedService service("twins_budget");
  service.repeat_scatter = 0.05;
  service.Submit(Campaign(1, "budget: {model_evaluations: 125}\n"));
  service.RunToEnd(1, true);
  EXPECT_TRUE(LogHas(service, "scatter is not measured: it would exceed the budget"));
  const v1::Posterior posterior = LastPosterior(service);
  for (const auto& scatter : posterior.scatter()) {
    EXPECT_EQ(scatter.from(), "emulator");
  }
}

TEST(Twins, TroubleChangesNoBit) { ExpectTroubleChangesNoBit(1); }

// The scatter joins the errors once, its size known from the twins.
TEST(Twins, ErrorsAreKnownFromAsManyAsThereAreAndTheMeanIsNotOffByThem) {
  const planning::Definition definition = *planning::MakeDefinition(ReadCampaignOf(Campaign(1)));
  const planning::Definition with =
      planning::DefinitionWith(definition, Measured(definition, "repeats", 8));
  EXPECT_EQ(with.known.packings, 8);
  EXPECT_GE(with.known.Freedom(), 7);
  EXPECT_TRUE(std::isfinite(with.known.Freedom()));
  EXPECT_FALSE(with.replicates.has_value());
  const double noise = definition.data.readings[0].sd;
  EXPECT_NEAR(with.mean_data->readings[0].sd, std::hypot(noise, 1), 1e-12);
  EXPECT_NEAR(with.data.readings[0].sd, std::hypot(noise, std::sqrt(2.0)), 1e-12);
}

TEST(Realizations, ASpecimenOfManyGrainsSharesLittleOfTheScatterAndIsKnownBetter) {
  testing::SmallCampaign campaign = Campaign(4);
  const std::string key = "    control: axial_strain\n";
  for (std::size_t at = campaign.yaml.find(key); at != std::string::npos;
       at = campaign.yaml.find(key, at + 60)) {
    campaign.yaml.insert(at, "    specimen_grains: 6400\n");
  }
  const Ended run = RunCampaign("scatter_grains", campaign, 0.05);
  ASSERT_EQ(run.posterior.scatter_size(), 2);
  EXPECT_DOUBLE_EQ(run.posterior.scatter(0).share(), 0.01);  // 64 of 6400
  // A specimen like the model's has the scatter once, the mean over four packings a quarter of it:
  // 1.25 against 0.26, beside the noise.
  const Ended like = RunCampaign("scatter_like", Campaign(4), 0.05);
  ASSERT_EQ(run.posterior.posterior_from(), "emulator");
  ASSERT_EQ(like.posterior.posterior_from(), "emulator");
  // Refits of the four packings, whose number is known to three degrees of freedom only.
  EXPECT_GT(like.posterior.emulator().widened(), 1);
  // Stiffness: friction leans on the bound of its prior here, whatever the errors.
  EXPECT_GT(like.posterior.parameters(0).cov(), 1.2 * run.posterior.parameters(0).cov());
}

// The p-value of the posterior asks how many packings the scatter is known from.
TEST(Realizations, ErrorsAreKnownFromAsManyPackingsAsThereAre) {
  const planning::Definition definition = *planning::MakeDefinition(ReadCampaignOf(Campaign(4)));
  EXPECT_EQ(definition.known.packings, 0);
  const planning::Definition with =
      planning::DefinitionWith(definition, Measured(definition, "realizations", 3));
  EXPECT_EQ(with.known.packings, 3);  // one of the four did not finish
  EXPECT_EQ(with.known.readings, static_cast<double>(with.data.readings.size()));
  // Two degrees of freedom where the scatter is all there is, more where noise stands beside it.
  EXPECT_GE(with.known.Freedom(), 2);
  EXPECT_TRUE(std::isfinite(with.known.Freedom()));
}

// The scatter joins the errors when the audited have long been chosen by the errors stated.
TEST(Realizations, TheAuditOfEarlyStoppingHoldsBoundAndShareByTheSameErrors) {
  const Ended run = RunCampaign("realizations_audit",
                                Campaign(4, "early_stopping: {discard_at_most: 1e-2}\n"), 0.2);
  EXPECT_GE(run.posterior.audited(), 1);
  EXPECT_LE(run.posterior.measured_loss(), run.posterior.audited_bound());
}

// What a finished answer has cost is what the campaign has: held-out runs come after the posterior.
TEST(Realizations, AFinishedPosteriorCountsItsHeldOutRuns) {
  SimulatedService simulated("realizations_count");
  simulated.Submit(Campaign(4));
  simulated.RunToEnd(1, true);
  store::Reader reader = simulated.Read();
  const auto total = Value(service::StatusOf(reader, 1, std::nullopt)).model_evaluations();
  const v1::Posterior stored =
      *planning::PosteriorFromJson(*Value(reader.Iterations(1))[1].posterior);
  EXPECT_GT(total, stored.model_evaluations());
  EXPECT_EQ(Value(service::PosteriorOf(reader, 1, std::nullopt)).model_evaluations(), total);
  EXPECT_EQ(Value(service::PosteriorOf(reader, 1, 1)).model_evaluations(), total);
  EXPECT_EQ(Value(service::PosteriorOf(reader, 1, 0)).model_evaluations(), kSamples);
}

TEST(Realizations, TroubleChangesNoBit) { ExpectTroubleChangesNoBit(3); }

TEST(Realizations, BudgetAllows) {
  const Ended run =
      RunCampaign("scatter_budget", Campaign(4, "budget: {model_evaluations: 125}\n"), 0.05);
  EXPECT_TRUE(std::none_of(run.iterations.begin(), run.iterations.end(),
                           [](const auto& i) { return i.proposal == planning::kReplicates; }));
  EXPECT_LE(run.evaluations, 125 + 20);  // held-out draws are not counted in advance
}

// A minute each: an hour for the first iteration, and another one for the second.
TEST(Budget, AnIterationThatWouldExceedTheCoreHoursIsNotBegun) {
  for (const bool enough : {false, true}) {
    SimulatedService service("core_hours");
    service.core_seconds = 60;
    service.Submit(
        Campaign(1, enough ? "budget: {core_hours: 2.5}\n" : "budget: {core_hours: 1.5}\n"));
    service.RunToEnd(1, true);
    const auto samples = Value(service.Read().Samples(1));
    const auto of_second = std::count_if(samples.begin(), samples.end(), [](const auto& sample) {
      return sample.iteration == 1 && sample.sample < 2 * kSamples;
    });
    EXPECT_EQ(of_second == kSamples, enough) << of_second;
    const auto log = Value(service.Read().Events(1));
    EXPECT_EQ(std::any_of(log.begin(), log.end(),
                          [](const auto& event) {
                            return event.what.find("exceed the budget") != std::string::npos;
                          }),
              !enough);
  }
}

testing::SmallCampaign ChainsOn(int packings) {
  return testing::MakeSmallCampaign({.samples = 20,
                                     .max_iterations = 40,
                                     .load_steps = 6,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.1,
                                     .packings = packings,
                                     .method = "tmcmc",
                                     .inference = "  steps: 2\n"});
}

TEST(Twins, OtherMethodsKeepTheirPosteriorAndStateTheScatter) {
  SimulatedService service("twins_tmcmc");
  service.repeat_scatter = 0.05;
  service.Submit(ChainsOn(1));
  service.RunToEnd(1, true);
  const v1::Posterior posterior = LastPosterior(service);
  ASSERT_EQ(posterior.scatter_size(), 1);
  EXPECT_EQ(posterior.scatter(0).from(), "repeats");
  EXPECT_EQ(posterior.scatter(0).runs(), 8);
  const auto said = Contains(HasSubstr("what twins of a run differ by is not in them"));
  EXPECT_THAT(posterior.warnings(), said);
  EXPECT_THAT(RunCampaign("smooth_tmcmc", ChainsOn(1), 0).posterior.warnings(), Not(said));
}

TEST(Realizations, OtherMethodsKeepTheirPosteriorAndStateTheScatter) {
  const testing::SmallCampaign campaign = ChainsOn(2);
  const Ended run = RunCampaign("scatter_tmcmc", campaign, 0.05);
  ASSERT_EQ(run.posterior.scatter_size(), 1);
  EXPECT_EQ(run.posterior.scatter(0).from(), "realizations");
  EXPECT_EQ(run.posterior.scatter(0).runs(), 2);
  EXPECT_THAT(run.posterior.warnings(),
              Contains(AllOf(HasSubstr("tmcmc compares runs by the stated errors alone"),
                             HasSubstr("runs on different packings"))));
}

TEST(Realizations, WeightsWithNoiseInferredSayThatScatterIsLeftOut) {
  for (const int packings : {1, 2}) {
    testing::SmallCampaign campaign = testing::MakeSmallCampaign({.samples = 300,
                                                                  .max_iterations = 1,
                                                                  .load_steps = 6,
                                                                  .relative_noise = 0.1,
                                                                  .packings = packings,
                                                                  .method = "sqmc"});
    const std::string given = "noise: given";
    campaign.yaml.replace(campaign.yaml.find(given), given.size(), "noise: inferred");
    const Ended run = RunCampaign("scatter_inferred", campaign, 0.02);
    ASSERT_EQ(run.posterior.posterior_from(), "weights");
    const auto left_out =
        HasSubstr("With noise inferred what runs on different packings differ by");
    if (packings == 1) {
      EXPECT_THAT(run.posterior.warnings(), Not(Contains(left_out)));
    } else {
      EXPECT_THAT(run.posterior.warnings(), Contains(left_out));
    }
  }
}

}  // namespace
}  // namespace calib::scheduler
