#include "server/campaign/checks/noise_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Loaded, unloaded and loaded again, `each` readings a stage; errors of sd 0.02.
Experiment Measured(const std::string& name, int each, double stated, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Experiment experiment;
  experiment.name = name;
  MeasuredObservable q{.name = "q_over_p", .values = {}, .sd = {}};
  for (int stage = 0; stage < 3; ++stage) {
    for (int k = 1; k <= each; ++k) {
      const double along = static_cast<double>(k) / each;
      const double strain = 0.01 * (stage == 1 ? 1 - 0.5 * along : along + 0.5 * (stage == 2));
      experiment.path.push_back(
          {.target = strain, .load_step = static_cast<int>(experiment.control.size())});
      experiment.control.push_back(strain);
      experiment.segment.emplace_back(stage == 0 ? "initial_loading"
                                                 : (stage == 1 ? "unload_1" : "reload_1"));
      q.values.push_back((stage == 1 ? 80 * (strain - 0.0075) : 1 - std::exp(-300 * strain)) +
                         0.02 * normal(random));
      q.sd.push_back(stated);
    }
  }
  experiment.observables = {q};
  return experiment;
}

TEST(NoiseCheck, SaysWhatTheCurvesThemselvesSay) {
  Campaign campaign;
  campaign.filter.noise = inference::NoiseMode::kGiven;
  campaign.experiments = {Measured("tx", 40, 0.02, 1)};
  EXPECT_THAT(NoiseWarnings(campaign), IsEmpty());
  campaign.experiments = {Measured("tx", 40, 0.006, 1)};
  EXPECT_THAT(Sentences(NoiseWarnings(campaign)),
              ElementsAre(::testing::AllOf(HasSubstr("tx, q_over_p: the readings scatter"),
                                           HasSubstr("stated too small"))));
  campaign.experiments = {Measured("tx", 40, 0.08, 1)};
  EXPECT_THAT(Sentences(NoiseWarnings(campaign)), ElementsAre(HasSubstr("stated too large")));
  campaign.filter.noise = inference::NoiseMode::kInferred;
  EXPECT_THAT(NoiseWarnings(campaign), IsEmpty());
}

// An error that goes together along the whole curve leaves its neighbours' differences alone; one
// that is too small is seen all the same.
TEST(NoiseCheck, ASmoothCurveSaysNothingAgainstErrorsThatGoTogether) {
  Campaign campaign;
  campaign.filter.noise = inference::NoiseMode::kGiven;
  campaign.experiments = {Measured("tx", 40, 0.2, 1)};
  EXPECT_THAT(NoiseWarnings(campaign), ::testing::SizeIs(1));
  campaign.experiments[0].observables[0].correlation_length = 0.01;
  EXPECT_THAT(NoiseWarnings(campaign), IsEmpty());
  // Of a length far below the distance of neighbours they are as good as independent.
  campaign.experiments[0].observables[0].correlation_length = 1e-5;
  EXPECT_THAT(NoiseWarnings(campaign), ::testing::SizeIs(1));
  campaign.experiments = {Measured("tx", 40, 0.002, 1)};
  campaign.experiments[0].observables[0].correlation_length = 0.01;
  EXPECT_THAT(Sentences(NoiseWarnings(campaign)), ElementsAre(HasSubstr("stated too small")));
}

// Two curves of 27 readings say together what neither says alone; of a held-out one nothing is
// taken.
TEST(NoiseCheck, ShortCurvesAreJudgedTogether) {
  Campaign campaign;
  campaign.filter.noise = inference::NoiseMode::kGiven;
  int alone = 0;
  int together = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    campaign.experiments = {Measured("a", 9, 0.005, seed)};
    alone += NoiseWarnings(campaign).empty() ? 0 : 1;
    campaign.experiments.push_back(Measured("b", 9, 0.005, seed + 100));
    campaign.experiments.push_back(Measured("c", 9, 0.005, seed + 200));
    together += NoiseWarnings(campaign).empty() ? 0 : 1;
  }
  EXPECT_GT(together, alone + 10);
  campaign.experiments = {Measured("a", 4, 0.005, 1), Measured("b", 9, 0.005, 2)};
  campaign.experiments[1].role = Role::kValidate;
  for (const Warning& warning : NoiseWarnings(campaign)) {
    EXPECT_NE(warning.experiment, "");
  }
}

TEST(NoiseCheck, ReadingsInAnyOrderAreNoCurve) {
  Campaign campaign;
  campaign.filter.noise = inference::NoiseMode::kGiven;
  campaign.experiments = {Measured("chute", 40, 0.001, 1)};
  std::mt19937 random(1);
  std::shuffle(campaign.experiments[0].control.begin(), campaign.experiments[0].control.end(),
               random);
  EXPECT_THAT(NoiseWarnings(campaign), IsEmpty());
}

}  // namespace
}  // namespace calib::campaign
