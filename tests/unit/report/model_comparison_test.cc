#include "server/report/views/model_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "server/report/documents/json_documents.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;

RivalModel Rival(const std::string& id, double log_evidence) {
  const CampaignView view = testing::ExampleView("model " + id);
  RivalModel rival{.campaign = view.campaign, .posterior = view.posterior};
  rival.posterior.set_campaign(id);
  rival.posterior.set_converged(true);
  rival.posterior.set_posterior_from("weights");
  rival.posterior.set_log_evidence(log_evidence);
  rival.posterior.set_log_evidence_se(0.1);
  return rival;
}

std::string Refusal(const std::vector<RivalModel>& rivals) {
  const auto comparison = CompareModels(rivals);
  return comparison.ok() ? "" : std::string(comparison.status().message());
}

TEST(ModelComparison, TheMostProbableComesFirstWithTheFieldsOfTheInterface) {
  const auto comparison = CompareModels({Rival("c1", 10), Rival("c2", 12), Rival("c3", 11)});
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_TRUE(comparison->warnings.empty());
  const auto json = nlohmann::json::parse(ModelsJson(*comparison));
  ASSERT_EQ(json["models"].size(), 3U);
  double sum = 0;
  for (const auto& model : json["models"]) {
    for (const char* field : {"campaign", "name", "log_evidence", "log_evidence_se", "probability",
                              "bayes_factor", "log_bayes_factor_se"}) {
      EXPECT_TRUE(model.contains(field)) << field;
    }
    sum += model["probability"].get<double>();
  }
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_EQ(json["models"][0]["campaign"], "c2");
  EXPECT_EQ(json["models"][0]["bayes_factor"], 1);
  EXPECT_EQ(json["models"][2]["campaign"], "c1");
  EXPECT_NEAR(json["models"][2]["bayes_factor"].get<double>(), std::exp(-2.0), 1e-12);
}

TEST(ModelComparison, ErrorsAndHeldOutDataMayDiffer) {
  RivalModel other = Rival("c2", 1);
  for (campaign::Experiment& experiment : other.campaign.experiments) {
    experiment.name += " again";
    for (campaign::MeasuredObservable& observable : experiment.observables) {
      for (double& sd : observable.sd) sd *= 2;
    }
  }
  other.campaign.experiments.pop_back();  // held out
  const auto comparison = CompareModels({Rival("c1", 0), other});
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  ASSERT_EQ(comparison->warnings.size(), 1U);
  EXPECT_THAT(comparison->warnings[0], HasSubstr("not stated as in c1: c2;"));
}

TEST(ModelComparison, AnotherMethodIsSaidToBeOne) {
  RivalModel other = Rival("c2", 1);
  other.campaign.method = campaign::Method::kTmcmc;
  ASSERT_NE(other.campaign.method, Rival("c1", 0).campaign.method);
  const auto comparison = CompareModels({Rival("c1", 0), other});
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  ASSERT_EQ(comparison->warnings.size(), 1U);
  EXPECT_THAT(comparison->warnings[0],
              HasSubstr("not found by the same method as that of c1: c2;"));
}

TEST(ModelComparison, OtherDataAreRefused) {
  RivalModel other = Rival("c2", 1);
  other.campaign.experiments.front().observables.front().values.back() += 1e-12;
  EXPECT_THAT(Refusal({Rival("c1", 0), other}), HasSubstr("c1 and c2 were fitted to different"));
}

TEST(ModelComparison, WithoutEvidenceOrARivalItIsRefused) {
  RivalModel none = Rival("c2", 1);
  none.posterior.set_posterior_from("none");
  EXPECT_THAT(Refusal({Rival("c1", 0), none}), HasSubstr("c2 has no evidence"));
  RivalModel best_fit = Rival("c2", std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(Refusal({Rival("c1", 0), best_fit}), HasSubstr("c2 has no evidence"));
  RivalModel tempered = Rival("c2", 1);
  tempered.campaign.filter.noise = inference::NoiseMode::kEssTarget;
  EXPECT_THAT(Refusal({Rival("c1", 0), tempered}), HasSubstr("ess_target"));
  EXPECT_THAT(Refusal({Rival("c1", 0)}), HasSubstr("at least two"));
  EXPECT_THAT(Refusal({Rival("c1", 0), Rival("c1", 0)}), HasSubstr("named twice"));
}

TEST(ModelComparison, ProvisionalAndEmulatedEvidenceIsSaidToBeSo) {
  RivalModel open = Rival("c2", 1);
  open.posterior.set_converged(false);
  RivalModel emulated = Rival("c3", 1);
  emulated.posterior.set_posterior_from("emulator");
  const auto comparison = CompareModels({Rival("c1", 0), open, emulated});
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  ASSERT_EQ(comparison->warnings.size(), 2U);
  EXPECT_THAT(comparison->warnings[0], HasSubstr("Not converged: c2;"));
  EXPECT_THAT(comparison->warnings[1], HasSubstr("emulator of the runs: c3;"));
}

}  // namespace
}  // namespace calib::report
