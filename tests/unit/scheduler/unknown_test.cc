// Samples on which a program fails as often as it may: set aside, whatever the method, and the
// posterior says so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr int kAttempts = 2;

// Every seventh sample fails, by the seed of its run, which is the campaign's plus its number.
void RunWithFailures(SimulatedService& service, const std::string& method, int samples,
                     int iterations) {
  service.fails = [](const v1::AttemptSpec& spec) { return spec.seed() % 7 == 3; };
  service.Submit(testing::MakeSmallCampaign({.samples = samples,
                                             .max_iterations = iterations,
                                             .load_steps = 6,
                                             .failure_attempts = kAttempts,
                                             .method = method,
                                             .inference = "  replicates: 0\n"}));
  service.RunToEnd(1, true);
}

class Unknown : public ::testing::TestWithParam<std::string> {};

TEST_P(Unknown, SamplesAreSetAsideAndTheCampaignFinishes) {
  const std::string method = GetParam();
  SimulatedService service("unknown-" + method);
  RunWithFailures(service, method, 40, method == "tmcmc" ? 12 : method == "sqmc" ? 1 : 2);
  ASSERT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished)
      << service.Campaign().progress.reason;
  const auto attempts = Value(service.Read().AttemptsBySample(1));
  int unknown = 0;
  for (const store::EvaluationRecord& evaluation : Value(service.Read().Evaluations(1))) {
    if (evaluation.status != store::EvaluationStatus::kUnknown) {
      if (evaluation.status != store::EvaluationStatus::kFinished) {  // a step of a chain
        EXPECT_EQ(evaluation.reason, "outside the prior: rejected without a run");
      }
      continue;
    }
    ++unknown;
    EXPECT_EQ(evaluation.failures, kAttempts);
    EXPECT_EQ(attempts.at(evaluation.key.sample), kAttempts);
    EXPECT_EQ(evaluation.reason, "failed 2 times, last: ended by SIGSEGV");
  }
  EXPECT_GT(unknown, 0);
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    for (const store::EvaluationRecord& evaluation : Value(service.Read().Evaluations(1))) {
      if (evaluation.key.sample == sample.sample &&
          evaluation.status == store::EvaluationStatus::kUnknown) {
        EXPECT_FALSE(std::exp(sample.log_weight) > 0) << sample.sample;
      }
    }
  }
  const v1::Posterior posterior = LastPosterior(service);
  EXPECT_GT(posterior.unknown(), 0);
  EXPECT_LE(posterior.unknown(), unknown);
  EXPECT_FALSE(posterior.converged());
  EXPECT_THAT(posterior.warnings(), Contains(HasSubstr("are unknown, for the program failed")));
  const bool is_filter = method == "iterative_bayesian_filter" || method == "sqmc";
  EXPECT_EQ(std::isfinite(posterior.unknown_mass()), is_filter);
  if (is_filter) {
    EXPECT_GT(posterior.unknown_mass(), 0);
  }
  // A new server process finds them as they are.
  const std::string before = service.Fingerprint();
  service.Restart();
  EXPECT_EQ(service.Fingerprint(), before);
}

INSTANTIATE_TEST_SUITE_P(Methods, Unknown,
                         ::testing::Values("iterative_bayesian_filter", "sqmc", "tmcmc",
                                           "surrogate_msrs"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace calib::scheduler
