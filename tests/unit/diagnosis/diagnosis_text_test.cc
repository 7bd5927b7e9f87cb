// A diagnosis as one JSON document and as text: what each says of an answer.
#include <gmock/gmock.h>

#include <cstddef>
#include <nlohmann/json.hpp>

#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/plan_json.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::diagnosis {
namespace {

using nlohmann::json;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// Two effects that are alike, one that hardly counts and cannot be seen, and none of these.
Diagnosis TwoAlike() {
  Diagnosis d{.campaign = "c1",
              .design = "c2",
              .evaluations = 102,
              .packings = 8,
              .warnings = {"Only 20 readings are fitted."},
              .units = {{"rolling.friction", "1"}, {"twisting.friction", "1"}}};
  Answer& answer = d.answer;
  answer.probabilities = {
      {.effects = {"rolling"}, .probability = 0.55},
      {.effects = {"twisting"}, .probability = 0.3},
      {.effects = {}, .probability = 0.08},
      {.effects = {}, .none_of_these = true, .probability = 0.0684},
      {.effects = {"adhesion"}, .probability = 0.0009},
      {.effects = {"rolling", "adhesion"}, .probability = 0.0007},
  };
  answer.adequate = 0.08;
  answer.none_of_these = 0.0684;
  answer.credible_set.assign(answer.probabilities.begin(), answer.probabilities.begin() + 4);
  answer.families = {{.effects = {"rolling", "twisting"}, .probability = 0.8516}};
  answer.candidates = {
      {.effect = "rolling",
       .probability = 0.5507,
       .uncertain = 0.03,
       .amplitude = {{"rolling.friction", 0.2}},
       .p_value = 1e-5,
       .explained = 0.75,
       .rms = 1.25,
       .curves = {{.experiment = "low", .observable = "stress", .change = {1, 2, 3}}},
       .visible = {{"rolling.friction", 0.05}},
       .angles = {{"twisting", 7}, {"adhesion", 61}}},
      {.effect = "twisting",
       .probability = 0.3,
       .amplitude = {{"twisting.friction", 0.4}},
       .p_value = 2e-5,
       .explained = 0.7,
       .rms = 1.5,
       .visible = {{"twisting.friction", 0.1}},
       .angles = {{"rolling", 7}}},
      {.effect = "adhesion", .probability = 0.0016, .p_value = 0.6, .rms = 2.25},
  };
  answer.adequacy_p = 2e-5;
  answer.square = 60;
  answer.degrees = 18;
  answer.p_square = 1e-5;
  answer.rms = 2.5;
  answer.scatter = 1.5;
  answer.repeat_names_alone = 0.4;
  answer.not_excitable = {{"wall", "no wall"}, {"membrane", "no membrane"}, {"chute", "no wall"}};
  answer.runs = {{"scout", 11}, {"main", 40}};
  answer.sentence = VerdictInWords(answer);
  return d;
}

json Read(const Diagnosis& diagnosis) { return json::parse(DiagnosisJson(diagnosis)); }

TEST(DiagnosisJson, ProbabilitiesOfAllModelsSumToOne) {
  const json read = Read(TwoAlike());
  const json expected = json::parse(R"([{"effects": ["rolling"], "probability": 0.55},
                                        {"effects": ["twisting"], "probability": 0.3},
                                        {"effects": [], "probability": 0.08}])");
  ASSERT_EQ(read["probabilities"].size(), 4U) << "those below one in a thousand are one";
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(read["probabilities"][i], expected[i]) << i;
  EXPECT_EQ(read["probabilities"][3]["effects"], json::array({"other"}));
  EXPECT_NEAR(read["probabilities"][3]["probability"].get<double>(), 0.0016, 1e-12);
  EXPECT_EQ(read["none_of_these"], 0.0684);
  double sum = read["none_of_these"].get<double>();
  for (const json& model : read["probabilities"]) sum += model["probability"].get<double>();
  EXPECT_NEAR(sum, 1, 1e-12);
}

TEST(DiagnosisJson, ACredibleSetMayHoldTheBaseModelAndNoneOfThese) {
  EXPECT_EQ(Read(TwoAlike())["credible_set"],
            json::parse(R"([["rolling"], ["twisting"], [], ["none_of_these"]])"));
}

TEST(DiagnosisJson, OthersOfTheSetStandWithTheFirstCandidateAlone) {
  Diagnosis d = TwoAlike();
  json candidates = Read(d)["candidates"];
  EXPECT_EQ(candidates[0]["confusable_with"], json::array({"twisting"}));
  EXPECT_EQ(candidates[1]["confusable_with"], json::array());
  // Nobody is confused with one that is not in the set.
  d.answer.credible_set = {{.effects = {}, .probability = 0.97}};
  EXPECT_EQ(Read(d)["candidates"][0]["confusable_with"], json::array());
}

TEST(DiagnosisJson, HasEveryFieldOfACandidate) {
  const json candidates = Read(TwoAlike())["candidates"];
  ASSERT_EQ(candidates.size(), 3U);
  const json expected = json::parse(R"({
    "effect": "rolling", "probability": 0.5507, "probability_sd": 0.03, "alone": false,
    "p_value": 1e-5, "explained_fraction": 0.75, "amplitude": {"rolling.friction": 0.2},
    "predicted_rms_error": 1.25, "confusable_with": ["twisting"],
    "angles": {"twisting": 7.0, "adhesion": 61.0},
    "curves": [{"experiment": "low", "observable": "stress", "change": [1.0, 2.0, 3.0]}]})");
  EXPECT_EQ(candidates[0], expected);
  EXPECT_EQ(candidates[2]["amplitude"], json::object()) << "of a model without draws there is none";
}

TEST(DiagnosisJson, HasEveryFieldBesideThem) {
  Diagnosis d = TwoAlike();
  const json read = Read(d);
  EXPECT_EQ(read["campaign"], "c1");
  EXPECT_EQ(read["verdict"], "ambiguous");
  EXPECT_EQ(read["effect"], nullptr);
  EXPECT_EQ(read["effects"], json::array());
  EXPECT_EQ(read["model_evaluations"], 102);
  EXPECT_EQ(read["next_experiment"], nullptr);
  ASSERT_EQ(read["families"].size(), 1U);
  EXPECT_EQ(read["families"][0]["effects"], json::array({"rolling", "twisting"}));
  EXPECT_EQ(read["families"][0]["probability"], 0.8516);
  EXPECT_EQ(read["specimens"], json::object({{"repeat_names_alone", 0.4}}));
  EXPECT_EQ(read["detectable"], json::parse(R"({"rolling": {"rolling.friction": 0.05},
                                                "twisting": {"twisting.friction": 0.1}})"));
  ASSERT_EQ(read["undetectable"].size(), 1U);
  EXPECT_EQ(read["undetectable"][0]["effect"], "adhesion");
  EXPECT_EQ(read["not_excitable"][0], json::object({{"effect", "wall"}, {"reason", "no wall"}}));
  EXPECT_EQ(read["adequacy"], json::parse(R"({"chi2": 60.0, "degrees": 18.0, "p_value": 2e-5,
      "p_chi2": 1e-5, "rms": 2.5, "scatter": 1.5, "packings": 8})"));
  EXPECT_EQ(read["design"],
            json::parse(R"({"campaign": "c2", "runs": {"scout": 11, "main": 40}})"));
  EXPECT_EQ(read["units"]["rolling.friction"], "1");
  EXPECT_EQ(read["warnings"], json::array({"Only 20 readings are fitted."}));
  EXPECT_EQ(read["sentence"], d.answer.sentence);
  EXPECT_EQ(read["only_adequacy"], false);
  d.answer.verdict = AnswerVerdict::kMissingEffect;
  d.answer.effects = {"rolling", "adhesion"};
  d.answer.candidates[0].alone = true;
  EXPECT_EQ(Read(d)["verdict"], "missing_effect");
  EXPECT_EQ(Read(d)["effect"], "rolling");
  EXPECT_EQ(Read(d)["effects"], json::array({"rolling", "adhesion"}));
  EXPECT_EQ(Read(d)["candidates"][0]["alone"], true);
  d.design = "";
  EXPECT_EQ(Read(d)["design"]["campaign"], nullptr) << "nothing was run";
}

// A gate does not know who is missing, and does not say that nobody is.
TEST(DiagnosisJson, OfTheGateHasNoProbabilities) {
  Diagnosis d{.campaign = "c1", .only_adequacy = true};
  d.answer.verdict = AnswerVerdict::kUnexplained;
  d.answer.adequacy_p = 0.002;
  d.answer.probabilities = {{.probability = 0.7}, {.none_of_these = true, .probability = 0.3}};
  d.answer.sentence = VerdictInWords(d.answer);
  const json read = Read(d);
  for (const char* name : {"probabilities", "none_of_these", "credible_set", "families",
                           "specimens", "detectable", "undetectable", "design"})
    EXPECT_FALSE(read.contains(name)) << name;
  EXPECT_EQ(read["verdict"], "unexplained");
  EXPECT_EQ(read["only_adequacy"], true);
  EXPECT_EQ(read["candidates"], json::array());
  EXPECT_EQ(read["adequacy"]["p_value"], 0.002);
  const std::string text = DiagnosisText(d);
  EXPECT_THAT(text, HasSubstr("The model misses the readings by more than noise and scatter"));
  EXPECT_THAT(text, HasSubstr("(p = 0.002)"));
  EXPECT_THAT(text, Not(HasSubstr("probability")));
}

TEST(DiagnosisJson, IsReadBackAsItWasSaid) {
  const Diagnosis d = TwoAlike();
  const auto stored = report::ReadDiagnosis(DiagnosisJson(d));
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->verdict, "ambiguous");
  EXPECT_EQ(stored->chi2, 60);
  EXPECT_FALSE(stored->only_adequacy);
}

TEST(DiagnosisText, HasATableOfModelsAndOneOfEffects) {
  const std::string text = DiagnosisText(TwoAlike());
  EXPECT_THAT(text, HasSubstr("rolling or twisting acts, 85 %: rolling, twisting, nothing"));
  EXPECT_THAT(text, HasSubstr("Error of the best fit: 2.5 sd; squared misfit 60"));
  EXPECT_THAT(text, HasSubstr("! Only 20 readings are fitted."));
  EXPECT_THAT(text, ContainsRegex("model +probability"));
  EXPECT_THAT(text, ContainsRegex("rolling +55 %"));
  EXPECT_THAT(text, ContainsRegex("the model as it is +8 %"));
  EXPECT_THAT(text, ContainsRegex("none of these +6\\.84 %"));
  EXPECT_THAT(text, ContainsRegex("all others +0\\.16 %"));
  EXPECT_THAT(text, ContainsRegex("effect +acts +named +explains +error +p"));
  EXPECT_THAT(text, ContainsRegex("rolling +55\\.1 % +75 % +1\\.25 +1e-05"));
  EXPECT_THAT(text, HasSubstr("hardly told apart by these tests: rolling, twisting"));
  EXPECT_THAT(text, HasSubstr("rolling fits best at rolling.friction = 0.2"));
  EXPECT_THAT(text, Not(HasSubstr("adhesion fits best")));
  EXPECT_THAT(text, HasSubstr("At no strength that it can have so often: adhesion."));
  EXPECT_THAT(text, HasSubstr("Not tried, because no wall: wall, chute."));
  EXPECT_THAT(text, HasSubstr("51 runs (main 40, scout 11) in c2, 102 model evaluations."));
}

TEST(DiagnosisText, ANamedEffectIsMarkedAndAFamilyOfOneIsNone) {
  Diagnosis d = TwoAlike();
  EXPECT_THAT(DiagnosisText(d), Not(ContainsRegex("rolling +55\\.1 % +yes")));
  d.answer.candidates[0].alone = true;
  d.answer.families = {{.effects = {"rolling"}, .probability = 0.96}};
  EXPECT_THAT(DiagnosisText(d), ContainsRegex("rolling +55\\.1 % +yes"));
  EXPECT_THAT(DiagnosisText(d), Not(HasSubstr("hardly told apart")));
}

TEST(DiagnosisText, WhatRestsOnWrongErrorsIsSaidWithDoubt) {
  Diagnosis d = TwoAlike();
  constexpr const char* kDoubt = "This is in doubt, for what the warnings say of the readings.";
  EXPECT_THAT(DiagnosisText(d), Not(HasSubstr("in doubt")));
  EXPECT_EQ(Read(d)["in_doubt"], false);
  d.in_doubt = true;
  EXPECT_THAT(Read(d)["sentence"].get<std::string>(), HasSubstr(kDoubt));
  EXPECT_EQ(Read(d)["in_doubt"], true);
  EXPECT_THAT(DiagnosisText(d), ContainsRegex("This is.in doubt"));
}

TEST(DiagnosisText, TheNextExperimentComesWithWhatItTellsApart) {
  Diagnosis d = TwoAlike();
  NextExperiment& next = d.next_experiment.emplace();
  next.best = {.test = "triaxial_drained",
               .settings = {{"confining_pressure", 8e5}},
               .control = "axial_strain",
               .path = {0.01, 0.1},
               .expected_power = 0.9,
               .distance = 5,
               .points = 3,
               .together = {{"twisting", "adhesion"}},
               .distance_from_none = 4.0,
               .power_against_none = 0.85,
               .forecast = PlanForecast{.bits = 0.75, .decides = 0.9, .wrong = 0.001, .runs = 43}};
  next.separates = {"rolling", "twisting"};
  next.snippet = "  - name: next1\n";
  next.considered = {next.best, next.best, next.best};
  next.considered[1].repeats = "low";
  next.considered[1].forecast->decides = 0.25;
  next.considered[2].forecast.reset();
  next.considered[2].expected_power = 0.05;
  next.evaluations = 30;
  const json read = Read(d)["next_experiment"];
  EXPECT_EQ(read["test"], "triaxial_drained");
  EXPECT_EQ(read["settings"], json::object({{"confining_pressure", 8e5}}));
  EXPECT_EQ(read["separates"], json::array({"rolling", "twisting"}));
  EXPECT_EQ(read["not_separated"], json::parse(R"([["twisting", "adhesion"]])"));
  EXPECT_EQ(read["expected_power"], 0.9);
  EXPECT_EQ(read["distance_sd"], 5);
  EXPECT_EQ(read["control_to"], 0.1);
  EXPECT_EQ(read["unloading"], false);
  EXPECT_EQ(read["none_of_these"], json::object({{"distance_sd", 4.0}, {"expected_power", 0.85}}));
  EXPECT_EQ(read["snippet"], "  - name: next1\n");
  EXPECT_EQ(read["path"], json::array({0.01, 0.1}));
  EXPECT_EQ(
      read["forecast"],
      json::object(
          {{"decides", 0.9}, {"names_wrong", 0.001}, {"told_apart_bits", 0.75}, {"runs", 43}}));
  ASSERT_EQ(read["considered"].size(), 3U);
  EXPECT_EQ(read["considered"][0]["repeat_of"], nullptr);
  EXPECT_EQ(read["considered"][1]["repeat_of"], "low");
  EXPECT_EQ(read["considered"][2]["forecast"], nullptr);
  EXPECT_EQ(Read(d)["model_evaluations"], 102) << "those of the proposal are not of the answer";
  const std::string text = DiagnosisText(d);
  EXPECT_THAT(text, HasSubstr("  - name: next1\n"));
  EXPECT_THAT(text, ContainsRegex("right\\s+one, +with +probability +90 % +.0.75 +bits."));
  EXPECT_THAT(text, HasSubstr("low again, on another specimen: one answer, and the right one, with "
                              "probability 25 %"));
  EXPECT_THAT(text, HasSubstr("at first sight tells none of them apart"));
  EXPECT_THAT(text, HasSubstr("would, with probability 90 %"));
}

TEST(DiagnosisJson, AProposalIsReadBackAsItWasMade) {
  PlannedExperiment planned{.test = "oedometric",
                            .settings = {{"confining_pressure", 2e5}},
                            .unloading_at = 0.02,
                            .control = "axial_strain",
                            .path = {0.01, 0.02, 0.015, 0.03},
                            .repeats = "low"};
  const auto read = PlannedFrom(PlannedJson(planned));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->test, planned.test);
  EXPECT_EQ(read->settings, planned.settings);
  EXPECT_EQ(read->unloading_at, planned.unloading_at);
  EXPECT_EQ(read->control, planned.control);
  EXPECT_EQ(read->path, planned.path);
  EXPECT_EQ(read->repeats, planned.repeats);
  json older = PlannedJson(planned);
  older.erase("path");
  EXPECT_FALSE(PlannedFrom(older).ok()) << "a proposal of an earlier build";
}

TEST(DiagnosisText, AMeasurementThatWasToldIsNamed) {
  Diagnosis d = TwoAlike();
  EXPECT_EQ(Read(d)["then"], nullptr);
  d.left_out = {"adhesion"};
  d.then = {.plan = {.test = "triaxial_drained",
                     .settings = {},
                     .control = "axial_strain",
                     .path = {0.01, 0.1},
                     .repeats = "low"},
            .file = "again.csv",
            .digest = "ab",
            .campaign = "c9",
            .evaluations = 6};
  const json read = Read(d);
  EXPECT_EQ(read["then"]["file"], "again.csv");
  EXPECT_EQ(read["then"]["campaign"], "c9");
  EXPECT_EQ(read["then"]["plan"]["repeat_of"], "low");
  EXPECT_EQ(read["without"], json::array({"adhesion"}));
  const std::string text = DiagnosisText(d);
  EXPECT_THAT(text, HasSubstr("With again.csv (low again, on another specimen): "));
  EXPECT_THAT(text, HasSubstr("6 runs of low again, on another specimen in c9."));
}

}  // namespace
}  // namespace calib::diagnosis
