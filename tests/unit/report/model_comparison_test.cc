#include "server/report/views/model_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "server/methods/registry.h"
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
  other.campaign.method = methods::All().Find("tmcmc");
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

// Two extensions of c1, which has no posterior: c2 with contact plasticity, c3 of c2 with a second
// effect.
std::vector<RivalModel> Family() {
  std::vector<RivalModel> rivals = {Rival("c3", 7), Rival("c1", 0), Rival("c2", 5)};
  rivals[1].posterior.set_posterior_from("none");
  const auto extends = [&rivals](std::size_t rival, const char* parent,
                                 const std::vector<std::string>& effects) {
    rivals[rival].campaign.lineage = {.parent = parent, .purpose = "extension"};
    for (const std::string& effect : effects)
      rivals[rival].campaign.model.effects.push_back(effect);
  };
  extends(0, "c2", {"twisting_resistance", "contact_plasticity"});
  extends(2, "c1", {"contact_plasticity"});
  return rivals;
}

StoredDiagnosis DiagnosisOfBase() {
  return {.campaign = "c1",
          .verdict = "ambiguous",
          .evidences = {
              {.effects = {}, .log_evidence = -20, .log_evidence_se = 0.1},
              {.effects = {"twisting_resistance"}, .log_evidence = -9, .log_evidence_se = 0.1},
              {.effects = {"contact_plasticity"}, .log_evidence = -3, .log_evidence_se = 0.2},
              {.effects = {"contact_plasticity", "twisting_resistance"},
               .log_evidence = -4,
               .log_evidence_se = 0.2}}};
}

TEST(ModelComparison, OfABaseWithoutAPosteriorTheDiagnosisGivesTheEvidences) {
  EXPECT_EQ(BaseOf(Family()), "c1");
  StoredDiagnosis gate{.campaign = "c1", .verdict = "unexplained", .only_adequacy = true};
  StoredDiagnosis another = DiagnosisOfBase();
  another.campaign = "c2";
  another.evidences[2].log_evidence = 100;
  const auto comparison = CompareModels(Family(), {DiagnosisOfBase(), gate, another});
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  ASSERT_EQ(comparison->models.size(), 3U);
  EXPECT_EQ(comparison->models[0].campaign, "c2");
  EXPECT_EQ(comparison->models[1].campaign, "c3") << "whatever the order of effects";
  EXPECT_EQ(comparison->models[2].campaign, "c1");
  EXPECT_NEAR(comparison->models[1].probability.log_bayes_factor, -1, 1e-12);
  EXPECT_NEAR(comparison->models[2].probability.log_bayes_factor, -17, 1e-12);
  EXPECT_NEAR(comparison->models[2].probability.log_bayes_factor_se, std::hypot(0.1, 0.2), 1e-12);
  ASSERT_EQ(comparison->warnings.size(), 1U);
  EXPECT_THAT(comparison->warnings[0], HasSubstr("those of the diagnosis of c1, since c1 has no"));
  EXPECT_EQ(nlohmann::json::parse(ModelsJson(*comparison))["evidence_from"], "diagnosis");

  std::vector<RivalModel> known = Family();
  known[1].posterior.set_posterior_from("emulator");
  const auto own = CompareModels(known, {DiagnosisOfBase()});
  ASSERT_TRUE(own.ok()) << own.status();
  EXPECT_EQ(own->evidence_from, "posterior");
  EXPECT_EQ(own->models[0].campaign, "c3");
}

TEST(ModelComparison, WhatADiagnosisSaysNothingOfIsRefused) {
  const auto refusal = [](const std::vector<RivalModel>& rivals,
                          const std::vector<StoredDiagnosis>& diagnoses) {
    return std::string(CompareModels(rivals, diagnoses).status().message());
  };
  EXPECT_THAT(refusal(Family(), {}), HasSubstr("`calibctl diagnose c1` gives evidences"));
  StoredDiagnosis without = DiagnosisOfBase();
  without.evidences.pop_back();
  EXPECT_THAT(refusal(Family(), {without}), HasSubstr("none of the model of c3"));
  std::vector<RivalModel> strangers = Family();
  strangers[2].campaign.lineage->purpose = "another";
  EXPECT_EQ(BaseOf(strangers), "");
  EXPECT_THAT(refusal(strangers, {DiagnosisOfBase()}), HasSubstr("c1 has no evidence"));
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
