#include <gmock/gmock.h>

#include "server/diagnosis/diagnosis.h"

namespace calib::diagnosis {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(DiagnosisText, AGroupComesWithTheAnglesBetweenItsEffects) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "ambiguous";
  diagnosis.candidates = {{.effect = "rolling_resistance",
                           .confusable_with = {"twisting_resistance"},
                           .angles = {{"twisting_resistance", 7}, {"adhesion_dmt", 61}}},
                          {.effect = "twisting_resistance",
                           .angles = {{"rolling_resistance", 7}, {"adhesion_dmt", 63}}},
                          {.effect = "adhesion_dmt", .angles = {{"rolling_resistance", 61}}}};
  const std::string text = DiagnosisText(diagnosis);
  EXPECT_THAT(text, HasSubstr("rolling_resistance and twisting_resistance 7°"));
  EXPECT_THAT(text, Not(HasSubstr("61")));
}

TEST(DiagnosisText, ThreePackingsMakeNoModelAdequate) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "adequate";
  diagnosis.packings = 3;
  EXPECT_THAT(DiagnosisText(diagnosis), HasSubstr("as far as 3 packings tell"));
  diagnosis.packings = 4;
  EXPECT_THAT(DiagnosisText(diagnosis), Not(HasSubstr("packings tell")));
}

TEST(DiagnosisText, WhatRestsOnWrongErrorsIsSaidWithDoubt) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "missing_effect";
  diagnosis.effect = "rolling_resistance";
  diagnosis.candidates = {{.effect = "rolling_resistance"}};
  EXPECT_THAT(DiagnosisText(diagnosis), Not(HasSubstr("for what the warnings say")));
  diagnosis.in_doubt = true;
  EXPECT_THAT(DiagnosisText(diagnosis), HasSubstr("for what the warnings say of the readings"));
  EXPECT_THAT(DiagnosisJson(diagnosis), HasSubstr("\"in_doubt\": true"));
}

TEST(DiagnosisText, ARefitThatIsFurtherOffThanItsOwnBaseModelHasFoundNothing) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "unexplained";
  diagnosis.candidates = {
      {.effect = "adhesion_dmt", .campaign = "c2", .refit_p_value = 0, .over_base = {.nats = -60}},
      {.effect = "twisting_resistance",
       .explained_fraction = 0.5,
       .campaign = "c3",
       .refit_p_value = 0,
       .over_base = {.nats = 50}}};
  const std::string text = DiagnosisText(diagnosis);
  EXPECT_THAT(text, ContainsRegex("adhesion_dmt +1 +not found"));
  EXPECT_THAT(text, HasSubstr("came no closer than the model without the effect"));
  EXPECT_THAT(text, Not(HasSubstr("adhesion_dmt comes closest")));
  EXPECT_THAT(text, HasSubstr("twisting_resistance comes closest"));
  diagnosis.candidates.erase(diagnosis.candidates.begin());
  EXPECT_THAT(DiagnosisText(diagnosis), Not(HasSubstr("not found")));
}

TEST(DiagnosisText, AShareExplainedBesideALargerErrorIsPutInWords) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "unexplained";
  diagnosis.rms = 2;
  diagnosis.candidates = {{.effect = "adhesion_dmt",
                           .explained_fraction = 0.34,
                           .predicted_rms_error = 2.2,
                           .campaign = "c2",
                           .refit_p_value = 0,
                           .over_base = {.nats = 5}}};
  EXPECT_THAT(DiagnosisText(diagnosis), HasSubstr("Explains: share of the excess of chi-squared"));
  diagnosis.candidates.front().predicted_rms_error = 1.8;
  EXPECT_THAT(DiagnosisText(diagnosis), Not(HasSubstr("share of the excess")));
}

// What needs no runs has none that could be used up.
TEST(DiagnosisText, ACalculatedEffectThatHelpsNothingExplainsNothing) {
  diagnosis::Diagnosis diagnosis;
  diagnosis.verdict = "unexplained";
  diagnosis.candidates = {{.effect = "strain_offset", .refit_p_value = 0, .over_base = {}}};
  const std::string text = DiagnosisText(diagnosis);
  EXPECT_THAT(text, ContainsRegex("strain_offset +1 +0 %"));
  EXPECT_THAT(text, Not(HasSubstr("more samples tell")));
  EXPECT_THAT(text, Not(HasSubstr("comes closest")));
}

}  // namespace
}  // namespace calib::diagnosis
