// Campaigns derived from others, which begin where these have ended: of every method, through the
// store and simulated workers.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/campaign/file/derive.h"
#include "server/methods/registry.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

struct Place {
  double young_modulus = 0;   // Pa
  double friction_angle = 0;  // rad
};
constexpr double kSd = 0.02;  // of both, relative

// E in [50, 500] MPa, friction angle in [0.17, 0.70] rad. place: half of the first samples about
// it.
testing::SmallCampaign Derived(const std::string& method, const std::optional<Place>& place,
                               const std::string& extra = "", int stages = 50) {
  const bool tmcmc = method == "tmcmc";
  testing::SmallCampaign campaign =
      testing::MakeSmallCampaign({.samples = tmcmc ? 80 : 21,
                                  .max_iterations = tmcmc              ? stages
                                                    : method == "sqmc" ? 1
                                                                       : 2,
                                  .load_steps = 12,
                                  .failure_attempts = 100,
                                  .method = method,
                                  .inference = tmcmc ? "  steps: 3\n" : "",
                                  .extra = extra});
  if (!place) return campaign;
  campaign::FirstProposal first{.prior_share = 0.5, .places = {}};
  for (const auto& [name, center] : {std::pair{"young_modulus", place->young_modulus},
                                     {"friction_angle", place->friction_angle}})
    first.places[name] = {.center = center, .sd = kSd * center};
  const auto text = campaign::Derive(methods::All(), campaign.yaml,
                                     {.name = "derived",
                                      .lineage = {.parent = "c1", .purpose = "extension"},
                                      .first_proposal = first});
  EXPECT_TRUE(text.ok()) << text.status();
  campaign.yaml = *text;
  return campaign;
}

std::vector<store::SampleRecord> FirstSamples(SimulatedService& service) {
  auto samples = Value(service.Read().Samples(1));
  std::erase_if(samples, [](const store::SampleRecord& s) { return s.iteration != 0; });
  return samples;
}

// Within five sd: of ln E, and of the angle.
bool IsAbout(const Place& place, const store::SampleRecord& sample) {
  return std::abs(sample.parameters[0] / place.young_modulus - 1) < 5 * 1.1 * kSd &&
         std::abs(sample.parameters[1] / place.friction_angle - 1) < 5 * kSd;
}

// Rows that are run with the first samples, with the numbers and specimens of others.
testing::SmallCampaign WithRows(int rows) {
  testing::SmallCampaign campaign = Derived("iterative_bayesian_filter", std::nullopt);
  campaign::Derivation derivation{.name = "derived",
                                  .lineage = {.parent = "c1", .purpose = "extension"},
                                  .method = "iterative_bayesian_filter"};
  for (int i = 0; i < rows; ++i) {
    derivation.rows.push_back(
        {.like = 100 + i,
         .values = {{"young_modulus", 2e8 * (1 + 0.05 * i)}, {"friction_angle", 0.4}}});
  }
  const auto text = campaign::Derive(methods::All(), campaign.yaml, derivation);
  EXPECT_TRUE(text.ok()) << text.status();
  campaign.yaml = *text;
  return campaign;
}

TEST(GivenRuns, AreTheFirstOfTheFirstIterationAndHaveNoWeight) {
  SimulatedService service("given_runs");
  service.Submit(WithRows(5));
  const auto first = FirstSamples(service);
  ASSERT_EQ(first.size(), 26U);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_NEAR(first[i].parameters[0], 2e8 * (1 + 0.05 * static_cast<double>(i)), 1e-3) << i;
  service.RunToEnd(1, /*calm=*/true);
  const auto samples = Value(service.Read().Samples(1));
  int of_second = 0;
  int weighed = 0;
  for (const store::SampleRecord& sample : samples) {
    if (sample.sample < 5) {
      EXPECT_EQ(sample.log_weight, -INFINITY) << sample.sample;
    }
    of_second += sample.iteration == 1 ? 1 : 0;
    weighed += sample.log_weight > -INFINITY ? 1 : 0;
  }
  EXPECT_GT(weighed, 0);
  EXPECT_EQ(of_second, 21) << "later iterations have their own samples alone";
}

// What has been run is not run again: those of an extension are runs of a design.
TEST(GivenRuns, AreFoundWhereTheyWereRun) {
  SimulatedService service("given_runs_found");
  service.Submit(WithRows(5));
  service.RunToEnd(1, /*calm=*/true);
  service.Submit(WithRows(3));
  const auto evaluations = Value(service.Read().Evaluations(2));
  int reused = 0;
  for (const store::EvaluationRecord& evaluation : evaluations)
    reused += evaluation.key.sample < 3 && evaluation.reused ? 1 : 0;
  EXPECT_EQ(reused, 3);
}

TEST(GivenRuns, SameBitsWhateverGoesWrong) {
  std::string calm;
  for (const unsigned seed : {0U, 1U, 2U}) {
    SimulatedService service("given_runs_bits");
    service.Submit(WithRows(5));
    service.RunToEnd(seed, seed == 0);
    if (seed == 0) calm = service.Fingerprint();
    EXPECT_EQ(service.Fingerprint(), calm) << seed;
  }
}

TEST(FirstProposal, EveryMethodBeginsThere) {
  const Place place{.young_modulus = 2e8, .friction_angle = 0.4};
  for (const std::string method :
       {"iterative_bayesian_filter", "sqmc", "tmcmc", "surrogate_msrs"}) {
    for (const bool there : {false, true}) {
      SimulatedService service("first_proposal");
      service.Submit(Derived(method, there ? std::optional(place) : std::nullopt));
      const auto samples = FirstSamples(service);
      const auto about =
          std::count_if(samples.begin(), samples.end(),
                        [&place](const store::SampleRecord& s) { return IsAbout(place, s); });
      const auto n = static_cast<double>(samples.size());
      ASSERT_EQ(samples.size(), method == "tmcmc" ? 80U : 21U);
      if (!there) {
        EXPECT_LT(static_cast<double>(about), 0.2 * n) << method;
        continue;
      }
      // Four sd of a binomial number; some of the prior's lie there as well.
      EXPECT_GT(static_cast<double>(about), 0.5 * n - 2 * std::sqrt(n)) << method;
      EXPECT_LT(static_cast<double>(about), 0.6 * n + 2 * std::sqrt(n)) << method;
    }
  }
}

// Half of 21 points, which is eleven of the hypercube and ten here: the centre and nine draws; also
// where the priors are tied.
TEST(FirstProposal, TheDesignOfASurrogateHasItsCentreAndDraws) {
  const Place place{.young_modulus = 2e8, .friction_angle = 0.35};
  for (const std::string extra :
       {"", "prior_correlation: [[young_modulus, friction_angle, -0.7]]\n",
        "constraints: [friction_angle + 0.001 rad/MPa * young_modulus <= 0.6 rad]\n"}) {
    SimulatedService service("first_design");
    service.Submit(Derived("surrogate_msrs", place, extra));
    const auto samples = FirstSamples(service);
    ASSERT_EQ(samples.size(), 21U);
    EXPECT_NEAR(samples[0].parameters[0], place.young_modulus, 1e-9 * place.young_modulus);
    EXPECT_NEAR(samples[0].parameters[1], place.friction_angle, 1e-9 * place.friction_angle);
    int apart = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (i < 10) {
        EXPECT_TRUE(IsAbout(place, samples[i])) << i << extra;
      } else if (!IsAbout(place, samples[i])) {
        ++apart;
      }
    }
    EXPECT_GE(apart, 10) << extra;
  }
}

// As where the parent has no posterior: the hypercube is all there is.
TEST(FirstProposal, OfNoParameterLeavesADesignAsItIs) {
  SimulatedService plain("design_plain");
  plain.Submit(Derived("surrogate_msrs", std::nullopt));
  plain.RunToEnd(1, true);
  testing::SmallCampaign campaign = Derived("surrogate_msrs", std::nullopt);
  campaign.yaml.replace(campaign.yaml.find("  samples:"), 0,
                        "  first_proposal: {prior_share: 0.5}\n");
  SimulatedService named("design_named");
  named.Submit(campaign);
  named.RunToEnd(1, true);
  EXPECT_TRUE(named.Fingerprint() == plain.Fingerprint());
}

TEST(FirstProposal, LeavesPosteriorAndEvidenceOfChainsAsTheyAre) {
  const auto run = [](const char* name, const std::optional<Place>& place) {
    SimulatedService service(name);
    service.Submit(Derived("tmcmc", place));
    service.RunToEnd(1, true);
    return LastPosterior(service);
  };
  const v1::Posterior expected = run("chains_prior", std::nullopt);
  ASSERT_EQ(expected.posterior_from(), "tmcmc");
  const Place mean{.young_modulus = expected.parameters(0).mean(),
                   .friction_angle = expected.parameters(1).mean()};
  const Place far{.young_modulus = 6e7, .friction_angle = 0.65};
  for (const Place& place : {mean, far}) {
    const v1::Posterior found = run("chains_first", place);
    ASSERT_EQ(found.posterior_from(), "tmcmc");
    EXPECT_TRUE(found.converged());
    const double error = 4 * std::sqrt(1 / found.ess() + 1 / expected.ess());
    for (int i = 0; i < found.parameters_size(); ++i) {
      const double sd = expected.parameters(i).sd();
      EXPECT_NEAR(found.parameters(i).mean(), expected.parameters(i).mean(), error * sd);
      EXPECT_NEAR(found.parameters(i).sd(), sd, error * sd);
    }
    EXPECT_NEAR(found.log_evidence(), expected.log_evidence(),
                4 * std::hypot(found.log_evidence_se(), expected.log_evidence_se()));
  }
}

TEST(FirstProposal, SameBitsWhateverGoesWrong) {
  const Place place{.young_modulus = 2e8, .friction_angle = 0.4};
  for (const std::string method : {"tmcmc", "surrogate_msrs"}) {
    SimulatedService calm("first_calm");
    calm.Submit(Derived(method, place, "", 1));
    calm.RunToEnd(1, true);
    SimulatedService storm("first_storm");
    storm.Submit(Derived(method, place, "", 1));
    storm.RunToEnd(2, false);
    EXPECT_TRUE(storm.Fingerprint() == calm.Fingerprint()) << method;
  }
}

}  // namespace
}  // namespace calib::scheduler
