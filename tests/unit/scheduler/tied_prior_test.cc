// Constraints, correlations, parameters held and groups of noise as whole campaigns: through the
// campaign file, the store and simulated workers.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// E in [50, 500] MPa, friction angle in [0.17, 0.70] rad.
constexpr const char* kConstraint =
    "constraints: [friction_angle + 0.001 rad/MPa * young_modulus <= 0.6 rad]\n";
constexpr const char* kCorrelation = "prior_correlation: [[young_modulus, friction_angle, -0.7]]\n";

bool Meets(double young_modulus, double friction_angle) {
  return friction_angle + 1e-9 * young_modulus <= 0.6;
}

testing::SmallCampaign Campaign(const std::string& method, const std::string& inference,
                                const std::string& extra) {
  const bool tmcmc = method == "tmcmc";
  return testing::MakeSmallCampaign({.samples = tmcmc ? 60 : 20,
                                     .max_iterations = tmcmc              ? 40
                                                       : method == "sqmc" ? 1
                                                                          : 3,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.05,
                                     .method = method,
                                     .inference = inference,
                                     .extra = extra});
}

TEST(TiedPriors, NoRunOfAnyMethodViolatesAConstraint) {
  struct Case {
    const char* method;
    const char* inference;
  };
  for (const Case& c : {Case{"iterative_bayesian_filter", ""},
                        Case{"iterative_bayesian_filter", "  design: latin_hypercube\n"},
                        Case{"sqmc", ""}, Case{"tmcmc", ""}, Case{"surrogate_msrs", ""},
                        Case{"surrogate_msrs", "  surrogate: gaussian_process\n"}}) {
    SimulatedService service("tied");
    service.Submit(Campaign(c.method, c.inference, std::string(kConstraint) + kCorrelation));
    service.RunToEnd(1, true);
    EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished)
        << service.Campaign().progress.reason;
    const std::vector<store::SampleRecord> run = SamplesRun(service);
    EXPECT_GE(run.size(), 20U);
    for (const store::SampleRecord& sample : run) {
      EXPECT_TRUE(Meets(sample.parameters[0], sample.parameters[1])) << c.method << c.inference;
    }
    const v1::Posterior posterior = LastPosterior(service);
    for (int i = 0; i + 1 < posterior.draws_size(); i += 2) {
      EXPECT_TRUE(Meets(posterior.draws(i), posterior.draws(i + 1))) << c.method;
    }
  }
}

TEST(HeldParameters, AreTheSameInEveryLaterSampleAndReportedAsGiven) {
  SimulatedService service("held");
  service.Submit(Campaign("iterative_bayesian_filter",
                          "  freeze: {1: [young_modulus]}\n  tolerance: 1e-9\n  replicates: 0\n",
                          ""));
  service.RunToEnd(1, true);
  const v1::Posterior posterior = LastPosterior(service);
  ASSERT_EQ(posterior.parameters_size(), 2);
  EXPECT_TRUE(posterior.parameters(0).conditioned_on());
  EXPECT_FALSE(posterior.parameters(1).conditioned_on());
  EXPECT_TRUE(std::isnan(posterior.parameters(0).sd()));
  EXPECT_FALSE(std::isnan(posterior.parameters(1).sd()));
  ASSERT_GE(posterior.warnings_size(), 1);
  EXPECT_THAT(posterior.warnings(0), HasSubstr("Conditioned on young_modulus = "));
  int later = 0;
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    if (sample.iteration == 0) continue;
    EXPECT_EQ(sample.parameters[0], posterior.parameters(0).mean());
    ++later;
  }
  EXPECT_GE(later, 20);
}

TEST(HeldParameters, SameBitsWhateverGoesWrong) {
  const auto campaign = Campaign("iterative_bayesian_filter",
                                 "  freeze: {1: converged, 2: [young_modulus]}\n"
                                 "  reversed_path: true\n  tolerance: 1e-9\n",
                                 "early_stopping: {discard_at_most: 1e-3}\n");
  SimulatedService calm("held_calm");
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  const v1::Posterior posterior = LastPosterior(calm);
  EXPECT_EQ(posterior.reversed_path_size(), posterior.path_size());
  EXPECT_GT(posterior.path_size(), 0);
  SimulatedService storm("held_storm");
  storm.Submit(campaign);
  storm.RunToEnd(2, false);
  EXPECT_TRUE(storm.Fingerprint() == calm.Fingerprint());
}

TEST(GaussianProcessSurrogate, SameBitsWhateverGoesWrong) {
  const auto campaign = Campaign("surrogate_msrs", "  surrogate: gaussian_process\n", "");
  SimulatedService calm("gp_calm");
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  SimulatedService storm("gp_storm");
  storm.Submit(campaign);
  storm.RunToEnd(3, false);
  EXPECT_TRUE(storm.Fingerprint() == calm.Fingerprint());
}

TEST(NoiseGroups, TheirScaleIsReportedByName) {
  auto campaign = Campaign("iterative_bayesian_filter", "", "");
  const std::string given = "noise: given";
  campaign.yaml.replace(
      campaign.yaml.find(given), given.size(),
      "noise:\n  inferred:\n    - {observables: [stress_ratio], shape: 2, rate: 2}");
  SimulatedService service("noise_groups");
  service.Submit(campaign);
  service.RunToEnd(1, true);
  const v1::Posterior posterior = LastPosterior(service);
  ASSERT_EQ(posterior.noise_scale_size(), 1);
  EXPECT_THAT(posterior.noise_scale(0).observables(), ElementsAre("tx.stress_ratio"));
  EXPECT_LT(posterior.noise_scale(0).q05(), posterior.noise_scale(0).q95());
}

}  // namespace
}  // namespace calib::scheduler
