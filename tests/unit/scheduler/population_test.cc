// Parameters with a value for each experiment as whole campaigns: through the campaign file, the
// store and simulated workers.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_replace.h"
#include "server/planning/answer.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

constexpr double kRadian = 0.017453292519943295;

TEST(Populations, MembersFollowFromTheirPartsSampleBySample) {
  campaign::Campaign campaign;
  campaign.parameters.resize(5);
  campaign.populations.push_back(
      {.name = "k", .common = 1, .spread = 2, .labels = {"A", "B"}, .scores = {3, 4}});
  Eigen::MatrixXd draws(3, 5);
  draws << 9, 10, 1, 0, 2,  //
      9, 20, 2, 1, -1,      //
      9, 30, 0, 5, 5;
  const Eigen::Vector3d weights(0.5, 0.25, 0.25);
  const auto members = planning::SummarizeMembers(campaign, draws, weights.array().log());
  ASSERT_EQ(members.size(), 2U);
  EXPECT_DOUBLE_EQ(members[0].mean, 0.5 * 10 + 0.25 * 22 + 0.25 * 30);
  EXPECT_DOUBLE_EQ(members[1].mean, 0.5 * 12 + 0.25 * 18 + 0.25 * 30);
  EXPECT_NEAR(members[1].sd, std::sqrt(0.5 * 36 + 0 + 0.25 * 144), 1e-12);
  EXPECT_FALSE(members[0].at_bound);
  EXPECT_DOUBLE_EQ(planning::SummarizeMembers(campaign, draws)[0].mean, (10 + 22 + 30) / 3.0);
  campaign.populations.clear();
  EXPECT_TRUE(planning::SummarizeMembers(campaign, draws).empty());
}

testing::SmallCampaign PerExperiment(const std::string& method) {
  const bool tmcmc = method == "tmcmc";
  testing::SmallCampaign small = testing::MakeSmallCampaign({.samples = tmcmc ? 100 : 40,
                                                             .max_iterations = tmcmc ? 40 : 3,
                                                             .load_steps = 8,
                                                             .failure_attempts = 100,
                                                             .relative_noise = 0.05,
                                                             .with_validation = true,
                                                             .method = method});
  const std::string yaml =
      absl::StrReplaceAll(small.yaml, {{"max: 40 deg}",
                                        "max: 40 deg, per: experiment, spread: {prior: "
                                        "half_normal, sd: 4 deg}}"}});
  EXPECT_NE(yaml, small.yaml);
  small.yaml = yaml;
  return small;
}

// In order: modulus, angle, its spread, and the scores of the fitted and of the held-out test.
void ExpectWithinBounds(double angle, double spread, double score) {
  EXPECT_GE(angle + spread * score, 10 * kRadian);
  EXPECT_LE(angle + spread * score, 40 * kRadian);
}

TEST(Populations, AreInferredByEveryMethodWithinTheirBounds) {
  for (const char* method : {"iterative_bayesian_filter", "tmcmc"}) {
    SCOPED_TRACE(method);
    SimulatedService service("population");
    service.Submit(PerExperiment(method));
    service.RunToEnd(1, true);
    EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished)
        << service.Campaign().progress.reason;
    const std::vector<store::SampleRecord> run = SamplesRun(service);
    EXPECT_GE(run.size(), 40U);
    for (const store::SampleRecord& sample : run) {
      ASSERT_EQ(sample.parameters.size(), 5U);
      for (const std::size_t score : {3U, 4U})
        ExpectWithinBounds(sample.parameters[1], sample.parameters[2], sample.parameters[score]);
    }
    const v1::Posterior posterior = LastPosterior(service);
    ASSERT_EQ(posterior.parameters_size(), 5);
    EXPECT_FALSE(posterior.parameters(2).nuisance());
    EXPECT_TRUE(posterior.parameters(3).nuisance());
    ASSERT_EQ(posterior.members_size(), 2);
    const auto& fitted = posterior.members(0);
    const auto& held_out = posterior.members(1);
    EXPECT_EQ(fitted.unit(), "rad");
    EXPECT_FALSE(fitted.nuisance());
    EXPECT_EQ(fitted.name().substr(0, 15), "friction_angle@");
    ASSERT_TRUE(std::isfinite(fitted.sd())) << posterior.posterior_from();
    EXPECT_LE(fitted.q05(), fitted.q50());
    EXPECT_LE(fitted.q50(), fitted.q95());
    // Nothing was read of the held-out test: its score is what it was, and its value is known less
    // well than that of the fitted one.
    EXPECT_NEAR(posterior.parameters(4).mean(), 0, 0.4);
    EXPECT_NEAR(posterior.parameters(4).sd(), 1, 0.3);
    EXPECT_GT(held_out.sd(), fitted.sd());
    // Draws that are told give the same as the record says.
    const int n = posterior.draws_size() / 5;
    if (n == 0) continue;
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      const auto draw = [&posterior, i](int j) { return posterior.draws(5 * i + j); };
      ExpectWithinBounds(draw(1), draw(2), draw(3));
      sum += draw(1) + draw(2) * draw(3);
    }
    EXPECT_NEAR(sum / n, fitted.mean(), 5 * fitted.sd() / std::sqrt(n));
  }
}

}  // namespace
}  // namespace calib::scheduler
