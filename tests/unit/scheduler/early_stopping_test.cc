#include "server/scheduler/early_stopping.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/scheduler/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

testing::SmallCampaign Campaign(const std::string& extra) {
  return testing::MakeSmallCampaign({.samples = 40,
                                     .max_iterations = 3,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.01,
                                     .extra = extra});
}

constexpr double kAllowed = 1e-3;
constexpr const char* kStopping = "early_stopping: {discard_at_most: 1e-3}\n";

v1::Posterior LastPosterior(SimulatedService& service) {
  return *PosteriorFromJson(*service.Read().Iterations(1)->back().posterior);
}

TEST(EarlyStopping, SavesStatesAndLosesNoMoreThanItStates) {
  SimulatedService full("full");
  full.Submit(Campaign(""));
  full.RunToEnd(1, true);
  SimulatedService stopping("stopping");
  stopping.Submit(Campaign(kStopping));
  stopping.RunToEnd(1, true);

  const v1::Posterior with = LastPosterior(stopping);
  EXPECT_GT(with.stopped_early(), 0);
  EXPECT_LE(with.stated_loss(), kAllowed);
  EXPECT_LT(stopping.Read().States(1)->size(), full.Read().States(1)->size());
  // The first iteration has nothing to compare with, so none of its samples is stopped.
  for (const store::EvaluationRecord& evaluation : Value(stopping.Read().Evaluations(1))) {
    if (evaluation.key.sample < 40) {
      EXPECT_EQ(evaluation.status, store::EvaluationStatus::kFinished);
    }
  }
  const v1::Posterior without = LastPosterior(full);
  EXPECT_EQ(without.stopped_early(), 0);
  EXPECT_EQ(without.stated_loss(), 0);
  for (int i = 0; i < with.parameters_size(); ++i) {
    const auto& parameter = without.parameters(i);
    // Stopped samples do not shape the next proposal, so the two campaigns draw other samples of the
    // same posterior: their means agree to its width, not to the stated loss.
    EXPECT_NEAR(with.parameters(i).mean(), parameter.mean(), parameter.sd());
  }
}

TEST(EarlyStopping, SameBitsWhateverGoesWrong) {
  SimulatedService calm("stopping_calm");
  calm.Submit(Campaign(kStopping));
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SimulatedService service("stopping_storm");
    service.Submit(Campaign(kStopping));
    service.RunToEnd(seed, false);
    EXPECT_TRUE(service.Fingerprint() == expected) << "seed " << seed;
  }
}

TEST(EarlyStopping, ThresholdIsNeverSetWithoutAFinishedSample) {
  SimulatedService service("thresholds");
  service.Submit(Campaign(kStopping));
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    EXPECT_TRUE(std::isnan(sample.stop_below));
  }
}

}  // namespace
}  // namespace calib::scheduler
