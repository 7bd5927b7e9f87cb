// Campaigns of which next to nothing comes to an end: a sentence that says what happened and what
// to change, and never a weight that is no number.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kStarted = 8;
constexpr int kSurvivorLoadSteps = 6;

/// An iteration of which the first samples come to their ends and the others diverge.
void RunIteration(SimulatedService& service, int survivors, const std::string& noise = "given",
                  const std::string& method = "iterative_bayesian_filter") {
  testing::SmallCampaign campaign =
      testing::MakeSmallCampaign({.samples = kStarted,
                                  .max_iterations = method == "sqmc" ? 1 : 2,
                                  .load_steps = kSurvivorLoadSteps,
                                  .method = method,
                                  .inference = "  replicates: 0\n"});
  const auto set = [&campaign](const std::string& from, const std::string& to) {
    campaign.yaml.replace(campaign.yaml.find(from), from.size(), to);
  };
  set("pause_above: 0.5", "pause_above: 1");
  set("noise: given", "noise: " + noise);
  service.Submit(campaign);
  const std::int64_t worker = service.Connect("w", 1);
  for (int k = 0; k < kStarted; ++k) {
    const v1::Lease lease = service.Next(worker, v1::ServerMessage::kLease).lease();
    if (k < survivors) service.SendStates(worker, lease, 0, kSurvivorLoadSteps);
    service.SendEnd(
        worker, lease.attempt(),
        k < survivors ? v1::Finished::OUTCOME_COMPLETED : v1::Finished::OUTCOME_DIVERGED,
        k < survivors ? "" : "a grain escaped");
  }
}

TEST(FewSurvivors, TheCampaignSaysHowManyAreLeftAndWhatWouldHelp) {
  for (const char* noise : {"given", "inferred",
                            "{model_error: [{observables: [stress_ratio], relative: {prior: "
                            "uniform, min: 0, max: 1}}]}"}) {
    for (const int survivors : {1, 2}) {
      SimulatedService service("survivors");
      RunIteration(service, survivors, noise);
      const store::CampaignProgress progress = service.Campaign().progress;
      EXPECT_EQ(progress.state, store::CampaignState::kFailed)
          << survivors << " of noise " << noise;
      EXPECT_THAT(
          progress.reason,
          AllOf(HasSubstr("of 8 samples " + std::to_string(survivors)),
                HasSubstr("2 parameters need more than 2"),
                HasSubstr(std::to_string(kStarted - survivors) + " did not come to their ends"),
                HasSubstr("`calibctl samples` says why"), HasSubstr("narrow the priors"),
                HasSubstr("Run more samples")));
    }
  }
}

TEST(FewSurvivors, AfterTheLastIterationThereIsNoPosteriorAndWhatWouldHelp) {
  SimulatedService service("last_survivor");
  RunIteration(service, 1, "given", "sqmc");
  EXPECT_EQ(service.Campaign().progress.state, store::CampaignState::kFinished);
  const auto posterior =
      planning::PosteriorFromJson(*Value(service.Read().Iterations(1)).front().posterior);
  ASSERT_TRUE(posterior.ok());
  EXPECT_EQ(posterior->posterior_from(), "none");
  EXPECT_TRUE(std::isnan(posterior->parameters(0).sd()));
  std::string warnings;
  for (const std::string& warning : posterior->warnings()) warnings += warning + "\n";
  EXPECT_THAT(warnings, AllOf(HasSubstr("7 of 8 samples did not come to their ends"),
                              HasSubstr("run more samples")));
  const auto samples = Value(service.Read().Samples(1));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].log_weight, i == 0 ? 0 : -INFINITY);
  }
}

TEST(FewSurvivors, WhereAllDivergeTheCampaignSaysSo) {
  SimulatedService service("no_survivors");
  RunIteration(service, 0);
  const store::CampaignProgress progress = service.Campaign().progress;
  EXPECT_EQ(progress.state, store::CampaignState::kFailed);
  EXPECT_THAT(progress.reason,
              AllOf(HasSubstr("no sample has a weight: of 8 samples 8 did not come to their ends"),
                    HasSubstr("narrow the priors to where the model runs")));
}

// Runs made elsewhere, in a unit that the priors do not have.
TEST(FewSurvivors, WhereAllLieOutsideThePriorTheCampaignSaysSo) {
  SimulatedService service("all_outside");
  service.Submit({.yaml = R"(name: elsewhere
model: {precomputed: {parameters: runs.csv, states: states.csv}}
parameters:
  young_modulus: {prior: uniform, min: 50 GPa, max: 200 GPa}
experiments:
  - name: oedo
    test: oedometric
    confining_pressure: 1 Pa
    data: {file: data.txt, columns: {axial_strain: e, mean_stress: p}}
    control: axial_strain
    observables: {mean_stress: {noise: {relative: 0.1}}}
noise: given
inference: {method: sqmc}
)",
                  .files = {{"data.txt", "# e p\n0 1\n0.1 2\n"},
                            {"runs.csv", "sample,young_modulus\n0,70\n1,120\n2,150\n"},
                            {"states.csv",
                             "sample,step,mean_stress\n0,0,1\n0,1,2\n1,0,1\n1,1,3\n2,0,1\n2,1,"
                             "4\n"}}});
  const store::CampaignProgress progress = service.Campaign().progress;
  EXPECT_EQ(progress.state, store::CampaignState::kFailed);
  EXPECT_THAT(progress.reason,
              AllOf(HasSubstr("of 3 samples 0 did not come to their ends and 3 lie outside"),
                    HasSubstr("widen the priors"), HasSubstr("units")));
}

}  // namespace
}  // namespace calib::scheduler
