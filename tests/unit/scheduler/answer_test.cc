#include "server/planning/answer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/planning/posterior_record.h"
#include "server/service/queries.h"
#include "tests/support/square_campaign.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;

testing::SmallCampaign Campaign(int samples, double noise) {
  return testing::MakeSmallCampaign({.samples = samples,
                                     .max_iterations = 2,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = noise,
                                     .with_validation = true});
}

v1::Posterior RunCampaign(SimulatedService& service, int samples, double noise) {
  service.Submit(Campaign(samples, noise));
  service.RunToEnd(1, true);
  v1::Posterior last;
  for (const store::IterationRecord& iteration : Value(service.Read().Iterations(1))) {
    if (iteration.posterior.has_value()) last = *planning::PosteriorFromJson(*iteration.posterior);
  }
  return last;
}

// After two iterations and the twins.
constexpr int kTwins = 2, kDraws = 3;

int HeldOutDraws(SimulatedService& service, int samples) {
  int draws = 0;
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    if (sample.iteration == kDraws) {
      EXPECT_EQ(sample.sample, kDraws * samples + draws);
      EXPECT_EQ(sample.log_weight, -INFINITY);
      ++draws;
    }
  }
  return draws;
}

TEST(Answer, WideNoiseLeavesWeightsThatSuffice) {
  SimulatedService service("answer_weights");
  const v1::Posterior posterior = RunCampaign(service, 200, 0.3);
  EXPECT_EQ(posterior.posterior_from(), "weights");
  EXPECT_FALSE(posterior.has_emulator());
  EXPECT_EQ(posterior.draws_size(), 0);
  EXPECT_GT(posterior.ess(), 50);
  ASSERT_GT(posterior.stage_p_size(), 0);
  EXPECT_NEAR(posterior.stage_p(0).p(), posterior.predictive_p(), 1e-9) << "nothing else is fitted";
  EXPECT_EQ(HeldOutDraws(service, 200), 0);
}

TEST(Answer, FewEffectiveSamplesAreEmulatedAndHeldOutTestsRunOnDraws) {
  SimulatedService service("answer_emulator");
  const v1::Posterior posterior = RunCampaign(service, 40, 0.02);
  EXPECT_EQ(posterior.posterior_from(), "emulator");
  EXPECT_LT(posterior.ess(), 50);
  EXPECT_TRUE(posterior.emulator().adequate());
  EXPECT_EQ(posterior.draws_size(), 2 * 400);
  ASSERT_EQ(posterior.bands_size(), 1);
  EXPECT_EQ(posterior.bands(0).experiment(), "tx");
  EXPECT_EQ(posterior.bands(0).observable(), "stress_ratio");
  ASSERT_EQ(posterior.bands(0).mean_size(), 12);
  EXPECT_LT(posterior.bands(0).q05(11), posterior.bands(0).q95(11));
  ASSERT_GT(posterior.stage_p_size(), 0);
  EXPECT_EQ(posterior.stage_p(0).last(), 11);
  // Every observable as a whole: here all there is, of a quarter of the draws.
  EXPECT_NEAR(posterior.stage_p(0).p(), posterior.predictive_p(), 0.03);
  for (const auto& parameter : posterior.parameters()) {
    EXPECT_LT(parameter.q05(), parameter.mean());
    EXPECT_LT(parameter.mean(), parameter.q95());
  }
  EXPECT_EQ(HeldOutDraws(service, 40), 20);
  for (const store::EvaluationRecord& evaluation : Value(service.Read().Evaluations(1))) {
    EXPECT_EQ(evaluation.status, store::EvaluationStatus::kFinished);
    if (evaluation.key.sample / 40 == kTwins) continue;  // of both tests
    EXPECT_EQ(evaluation.key.sample / 40 == kDraws, evaluation.key.experiment == 1)
        << "held-out tests are run for twins and draws alone, and draws for nothing else";
  }
}

TEST(Answer, WithTooFewRunsToEmulateNoIntervalIsGiven) {
  SimulatedService service("answer_none");
  const v1::Posterior posterior = RunCampaign(service, 4, 0.001);
  EXPECT_EQ(posterior.posterior_from(), "none");
  EXPECT_FALSE(posterior.converged());
  EXPECT_TRUE(std::isnan(posterior.log_evidence_se()));
  EXPECT_EQ(posterior.correlation_size(), 0);
  for (const auto& parameter : posterior.parameters()) {
    EXPECT_TRUE(std::isfinite(parameter.mean()));
    EXPECT_TRUE(std::isnan(parameter.sd()));
    EXPECT_TRUE(std::isnan(parameter.q05()));
    EXPECT_TRUE(std::isnan(parameter.q95()));
  }
  ASSERT_EQ(posterior.warnings_size(), 1);
  EXPECT_THAT(posterior.warnings(0), HasSubstr("No standard deviations, quantiles"));
  EXPECT_EQ(HeldOutDraws(service, 4), 0);
}

// The first reading is predicted as 1 + a - 0.3, the second as 1 + b - 0.7, or as 2.6 whatever b
// is: that one is missed by 16 sd, so that a is looked for by errors of 0.57 instead of 0.1.
TEST(Answer, FarFromTheReadingsTheNextSamplesAreLookedForWidely) {
  const auto definition = planning::MakeDefinition(testing::SquareCampaign());
  inference::Iteration iteration;
  iteration.parameters.resize(30, 2);
  for (Eigen::Index i = 0; i < 30; ++i) {  // a lattice of golden ratios
    iteration.parameters(i, 0) = std::fmod(0.5 + 0.754877666 * static_cast<double>(i), 1);
    iteration.parameters(i, 1) = std::fmod(0.5 + 0.569840291 * static_cast<double>(i), 1);
  }
  iteration.predictions = iteration.parameters.rowwise() + Eigen::RowVector2d(0.7, 0.3);
  const auto near = planning::FindAnswer(*definition, {&iteration, 1});
  ASSERT_TRUE(near.ok() && near->emulated.has_value()) << near.status();
  const planning::SearchDraws by_own =
      planning::DrawsToGoOnFrom(*definition, {&iteration, 1}, *near);
  EXPECT_EQ(by_own.draws, near->emulated->draws);
  EXPECT_EQ(by_own.closest.rows(), 0);

  iteration.predictions.col(1).setConstant(2.6);
  const auto far = planning::FindAnswer(*definition, {&iteration, 1});
  ASSERT_TRUE(far.ok() && far->emulated.has_value()) << far.status();
  const auto spread = [](const Eigen::MatrixXd& draws) {
    return std::sqrt((draws.col(0).array() - draws.col(0).mean()).square().mean());
  };
  EXPECT_LT(spread(far->emulated->draws), 0.15);
  const planning::SearchDraws wider = planning::DrawsToGoOnFrom(*definition, {&iteration, 1}, *far);
  EXPECT_GT(spread(wider.draws), 0.2);
  ASSERT_EQ(wider.closest.rows(), wider.draws.rows() / 10);
  EXPECT_LT((wider.closest.col(0).array() - 0.3).abs().maxCoeff(), 0.1) << "the best a";
}

TEST(Answer, TheBestMisfitOfACampaignIsThatOfAllItsIterations) {
  SimulatedService service("answer_best_misfit");
  RunCampaign(service, 4, 0.001);
  std::vector<double> misfits;
  for (const store::IterationRecord& iteration : Value(service.Read().Iterations(1))) {
    if (iteration.posterior.has_value()) {
      misfits.push_back(planning::PosteriorFromJson(*iteration.posterior)->best_misfit());
    }
  }
  ASSERT_EQ(misfits.size(), 2U);
  ASSERT_LT(misfits[0], misfits[1]) << "with these few samples the second comes no closer";
  store::Reader reader = service.Read();
  EXPECT_EQ(Value(service::StatusOf(reader, 1, std::nullopt)).best_misfit(), misfits[0]);
}

TEST(Answer, ARestartInTheMiddleChangesNoBit) {
  SimulatedService calm("answer_calm");
  calm.Submit(Campaign(40, 0.02));
  calm.RunToEnd(1, true);
  SimulatedService storm("answer_storm");
  storm.Submit(Campaign(40, 0.02));
  storm.RunToEnd(3, false);
  EXPECT_TRUE(storm.Fingerprint() == calm.Fingerprint());
}

}  // namespace
}  // namespace calib::scheduler
