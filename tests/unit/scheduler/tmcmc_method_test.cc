// tmcmc as a campaign: batches of proposals through simulated workers and the store.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/planning/history.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;

testing::SmallCampaign Campaign(int samples, int most_stages, const std::string& extra = "") {
  return testing::MakeSmallCampaign({.samples = samples,
                                     .max_iterations = most_stages,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.1,
                                     .method = "tmcmc",
                                     .inference = "  steps: 3\n",
                                     .extra = extra});
}

std::vector<store::EvaluationRecord> EvaluationsOf(SimulatedService& service, int experiment) {
  auto evaluations = Value(service.Read().Evaluations(1));
  std::erase_if(evaluations, [experiment](const store::EvaluationRecord& evaluation) {
    return evaluation.key.experiment != experiment;
  });
  return evaluations;
}

// One campaign looked at from several sides, because it takes seconds.
class FinishedTmcmcCampaign : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    service_ = new SimulatedService("tmcmc");
    service_->Submit(testing::MakeSmallCampaign({.samples = 80,
                                                 .max_iterations = 50,
                                                 .load_steps = 12,
                                                 .relative_noise = 0.1,
                                                 .with_validation = true,
                                                 .method = "tmcmc",
                                                 .inference = "  steps: 3\n"}));
    service_->RunToEnd(1, true);
  }
  static void TearDownTestSuite() { delete service_; }

  static inline SimulatedService* service_ = nullptr;
};

TEST_F(FinishedTmcmcCampaign, HasEquallyWeightedDrawsAndTheirEvidence) {
  const v1::Posterior posterior = LastPosterior(*service_);
  EXPECT_EQ(posterior.posterior_from(), "tmcmc");
  EXPECT_TRUE(posterior.converged());
  EXPECT_EQ(posterior.draws_size(), 2 * 80);
  EXPECT_EQ(posterior.correlation_size(), 4);
  EXPECT_TRUE(std::isfinite(posterior.log_evidence()));
  EXPECT_GT(posterior.log_evidence_se(), 0);
  EXPECT_GT(posterior.ess(), 50);
  EXPECT_EQ(posterior.iterations() % 3, 1) << "prior draws, then three steps per stage";
  double mass = 0;
  for (const store::SampleRecord& sample : Value(service_->Read().Samples(1))) {
    mass += std::exp(sample.log_weight);
  }
  EXPECT_NEAR(mass, 1, 1e-12) << "chains stand on runs of the campaign";
}

TEST_F(FinishedTmcmcCampaign, JudgesItsFitAndItself) {
  const v1::Posterior posterior = LastPosterior(*service_);
  ASSERT_TRUE(posterior.has_predictive_p());
  EXPECT_GT(posterior.predictive_p(), 0);
  EXPECT_LT(posterior.predictive_p(), 1);
  ASSERT_GT(posterior.stage_p_size(), 0);
  const auto& whole = posterior.stage_p(0);
  EXPECT_EQ(whole.experiment(), "tx");
  EXPECT_EQ(whole.observable(), "stress_ratio");
  EXPECT_EQ(whole.first(), 0);
  EXPECT_EQ(whole.last(), 11);
  EXPECT_NEAR(whole.p(), posterior.predictive_p(), 1e-9) << "nothing else is fitted";
  EXPECT_EQ(posterior.noise_scale_size(), 0) << "the noise is given";
  for (const auto& parameter : posterior.parameters()) {
    // Means of halves of 40 chains or so: 2 / sqrt(80) in the mean, of families somewhat more.
    EXPECT_GT(parameter.split_half(), 0);
    EXPECT_LT(parameter.split_half(), 4 * 2 / std::sqrt(80.0));
  }
}

TEST_F(FinishedTmcmcCampaign, HasNotRunProposalsOutsideThePrior) {
  int refused = 0;
  int runs = 0;
  for (const store::EvaluationRecord& evaluation : EvaluationsOf(*service_, 0)) {
    if (evaluation.status != store::EvaluationStatus::kStoppedEarly) {
      ++runs;
      continue;
    }
    EXPECT_THAT(evaluation.reason, HasSubstr("outside the prior"));
    EXPECT_GE(evaluation.key.sample, 80) << "the first batch is drawn from the prior";
    ++refused;
  }
  EXPECT_GT(refused, 0);
  EXPECT_EQ(LastPosterior(*service_).model_evaluations(), runs + 8)
      << "and the twins' held-out test";
  EXPECT_EQ(LastPosterior(*service_).stopped_early(), 0);
}

TEST_F(FinishedTmcmcCampaign, HasRunHeldOutTestsOnSomeOfTheChains) {
  const auto samples = Value(service_->Read().Samples(1));
  auto held_out = EvaluationsOf(*service_, 1);
  const store::IterationRecord last = Value(service_->Read().Iterations(1)).back();
  ASSERT_EQ(last.proposal, planning::kReplicates);
  const auto twins = std::erase_if(held_out, [&](const store::EvaluationRecord& evaluation) {
    return samples[static_cast<std::size_t>(evaluation.key.sample)].iteration == last.number;
  });
  EXPECT_EQ(twins, 8U);
  for (const store::EvaluationRecord& evaluation : held_out) {
    EXPECT_GT(samples[static_cast<std::size_t>(evaluation.key.sample)].log_weight, -INFINITY);
  }
  EXPECT_GE(held_out.size(), 15U);
  EXPECT_LE(held_out.size(), 20U);
}

// Of the same data: the weighted posterior of many samples drawn from the prior, with the noise
// given, inferred and with a model error.
TEST(TmcmcCampaign, AgreesWithManyWeightedSamples) {
  const std::string model_error =
      "{model_error: [{observables: [stress_ratio], relative: {prior: uniform, min: 0, max: 1}}]}";
  for (const std::string& noise : {std::string("given"), std::string("inferred"), model_error}) {
    const auto submit = [&noise](SimulatedService& service, testing::SmallCampaign campaign) {
      const std::string given = "noise: given";
      campaign.yaml.replace(campaign.yaml.find(given), given.size(), "noise: " + noise);
      service.Submit(campaign);
      service.RunToEnd(1, true);
      return LastPosterior(service);
    };
    SimulatedService chains("tmcmc_many");
    const v1::Posterior found = submit(chains, Campaign(150, 50));
    SimulatedService weights("weights_many");
    const v1::Posterior expected =
        submit(weights, testing::MakeSmallCampaign({.samples = 800,
                                                    .max_iterations = 1,
                                                    .load_steps = 12,
                                                    .relative_noise = 0.1,
                                                    .method = "sqmc"}));
    ASSERT_EQ(expected.posterior_from(), "weights");
    // Four standard errors of what 150 draws and 800 weighted samples know.
    const double error = 4 * std::sqrt(1 / found.ess() + 1 / expected.ess());
    for (int i = 0; i < found.parameters_size(); ++i) {
      const double sd = expected.parameters(i).sd();
      EXPECT_NEAR(found.parameters(i).mean(), expected.parameters(i).mean(), error * sd);
      EXPECT_NEAR(found.parameters(i).sd(), sd, error * sd);
    }
    EXPECT_NEAR(found.log_evidence(), expected.log_evidence(),
                4 * std::hypot(found.log_evidence_se(), expected.log_evidence_se()));
    ASSERT_EQ(found.has_predictive_p(), expected.has_predictive_p());
    if (expected.has_predictive_p()) {
      // A mean of numbers between 0 and 1, whose sd is 0.5 at most.
      EXPECT_NEAR(found.predictive_p(), expected.predictive_p(), 0.5 * error);
    }
    ASSERT_EQ(found.noise_scale_size(), expected.noise_scale_size());
    ASSERT_EQ(found.noise_scale_size(), noise == "inferred" ? 1 : 0);
    for (int g = 0; g < found.noise_scale_size(); ++g) {
      const auto& own = found.noise_scale(g);
      const auto& other = expected.noise_scale(g);
      EXPECT_EQ(own.observables(0), "tx.stress_ratio");
      const double range = other.q95() - other.q05();
      EXPECT_NEAR(own.q05(), other.q05(), error * range);
      EXPECT_NEAR(own.q50(), other.q50(), error * range);
      EXPECT_NEAR(own.q95(), other.q95(), error * range);
    }
    ASSERT_EQ(found.model_error_size(), noise == model_error ? 1 : 0);
    ASSERT_EQ(expected.model_error_size(), found.model_error_size());
    for (int g = 0; g < found.model_error_size(); ++g) {
      const auto& own = found.model_error(g).relative();
      const auto& other = expected.model_error(g).relative();
      EXPECT_EQ(found.model_error(g).observables(0), "tx.stress_ratio");
      EXPECT_FALSE(found.model_error(g).has_absolute());
      EXPECT_NEAR(own.mean(), other.mean(), error * other.sd());
      EXPECT_NEAR(own.q95(), other.q95(), error * (other.q95() - other.q05()));
    }
  }
}

TEST(TmcmcCampaign, SameBitsWhateverGoesWrong) {
  SimulatedService calm("tmcmc_calm");
  calm.Submit(Campaign(20, 2));
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 2; ++seed) {
    SimulatedService storm("tmcmc_storm");
    storm.Submit(Campaign(20, 2));
    storm.RunToEnd(seed, false);
    EXPECT_TRUE(storm.Fingerprint() == expected) << "seed " << seed;
  }
}

TEST(TmcmcCampaign, StagesOrBudgetUsedUpMeansNoIntervals) {
  for (const bool budget : {false, true}) {
    SimulatedService service("tmcmc_cap");
    service.Submit(
        Campaign(60, budget ? 50 : 1, budget ? "budget: {model_evaluations: 150}\n" : ""));
    service.RunToEnd(1, true);
    const v1::Posterior posterior = LastPosterior(service);
    EXPECT_EQ(posterior.posterior_from(), "none");
    EXPECT_FALSE(posterior.converged());
    EXPECT_TRUE(std::isnan(posterior.log_evidence()));
    EXPECT_TRUE(std::isnan(posterior.parameters(0).sd()));
    EXPECT_EQ(posterior.draws_size(), 0);
    ASSERT_EQ(posterior.warnings_size(), 1);
    EXPECT_THAT(posterior.warnings(0), HasSubstr("have not reached the posterior"));
    EXPECT_LE(posterior.model_evaluations(), budget ? 150 : 60 * 4);
  }
}

// The uniform number is drawn before the run, and a run ends once its bound stays below what it
// needs: the chains are the same, with fewer states.
TEST(TmcmcCampaign, StoppingEarlyChangesNothingInTheChains) {
  SimulatedService full("tmcmc_full");
  full.Submit(Campaign(60, 50));
  full.RunToEnd(1, true);
  SimulatedService stopping("tmcmc_stopping");
  stopping.Submit(Campaign(60, 50, "early_stopping: {discard_at_most: 1e-3}\n"));
  stopping.RunToEnd(1, true);
  const v1::Posterior expected = LastPosterior(full);
  const v1::Posterior found = LastPosterior(stopping);
  EXPECT_GT(found.stopped_early(), 0);
  EXPECT_EQ(found.stated_loss(), 0);
  EXPECT_EQ(found.log_evidence(), expected.log_evidence());
  ASSERT_EQ(found.draws_size(), expected.draws_size());
  for (int i = 0; i < found.draws_size(); ++i) EXPECT_EQ(found.draws(i), expected.draws(i));
  EXPECT_LT(stopping.Read().States(1)->size(), full.Read().States(1)->size());
}

}  // namespace
}  // namespace calib::scheduler
