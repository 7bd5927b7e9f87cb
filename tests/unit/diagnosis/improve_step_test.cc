#include "server/diagnosis/improve_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace calib::diagnosis {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

CandidateEffect Candidate(const std::string& effect, std::optional<double> log_bayes) {
  CandidateEffect candidate;
  candidate.effect = effect;
  if (log_bayes) {
    candidate.over_base_evidence = ScaledEvidence{.log_evidence = {0, *log_bayes, 0}};
  }
  return candidate;
}

Diagnosis GroupOf(std::vector<CandidateEffect> candidates) {
  Diagnosis diagnosis;
  diagnosis.verdict = "ambiguous";
  for (std::size_t k = 1; k < candidates.size(); ++k) {
    candidates.front().confusable_with.push_back(candidates[k].effect);
  }
  diagnosis.candidates = std::move(candidates);
  diagnosis.candidates.push_back(Candidate("outsider", 1e6));
  return diagnosis;
}

TEST(ImproveStep, ANamedEffectIsTriedAlone) {
  Diagnosis diagnosis;
  diagnosis.verdict = "missing_effect";
  diagnosis.effect = "a";
  diagnosis.candidates = {Candidate("a", 1), Candidate("b", 2)};
  EXPECT_THAT(EffectsToTry(diagnosis), ElementsAre("a"));
  EXPECT_EQ(WhyNext(diagnosis, "a"), "a is named and added.");
}

TEST(ImproveStep, AGroupIsTriedByEvidenceWhereThatOfAllIsKnown) {
  EXPECT_THAT(EffectsToTry(GroupOf({Candidate("a", 10), Candidate("b", 30), Candidate("c", 20)})),
              ElementsAre("b", "c", "a"));
  const Diagnosis partly =
      GroupOf({Candidate("a", 10), Candidate("b", std::nullopt), Candidate("c", 20)});
  EXPECT_THAT(EffectsToTry(partly), ElementsAre("a", "b", "c"));
  EXPECT_THAT(WhyNext(partly, "b"), HasSubstr("do not tell apart: a, c as well."));
}

TEST(ImproveStep, OthersAreTriedWhoseRefitsCameNear) {
  Diagnosis diagnosis;
  for (const auto& [effect, error] :
       {std::pair("wrong", 3.0), std::pair("near", 5.9), std::pair("far", 6.1),
        std::pair("nearer", 4.0), std::pair("third", 2.0)}) {
    diagnosis.candidates.push_back(Candidate(effect, std::nullopt));
    diagnosis.candidates.back().campaign = "c9";
    diagnosis.candidates.back().predicted_rms_error = error;
  }
  EXPECT_THAT(OthersToTry(diagnosis, "wrong", 3), ElementsAre("near", "nearer"));
  EXPECT_THAT(OthersToTry(diagnosis, "near", 1), ElementsAre("third"));
  diagnosis.candidates.back().campaign = "";
  EXPECT_THAT(OthersToTry(diagnosis, "near", 1), IsEmpty()) << "not refitted";
}

TEST(ImproveStep, WhatHelpsMostIsTriedWhereNothingExplains) {
  Diagnosis diagnosis;
  diagnosis.verdict = "unexplained";
  EXPECT_THAT(EffectsToTry(diagnosis), IsEmpty());
  diagnosis.best_partial = "a";
  EXPECT_THAT(EffectsToTry(diagnosis), ElementsAre("a"));
}

TEST(ImproveStep, AModelThatComesNoCloserIsNoStep) {
  const CalibratedModel without{.rms_error = 2, .has_posterior = true, .log_evidence = 0};
  EXPECT_EQ(WhyNoStep(without, {.rms_error = 1, .has_posterior = true, .log_evidence = 5}), "");
  EXPECT_EQ(WhyNoStep(without, {.rms_error = 2.5, .has_posterior = true, .log_evidence = 50}),
            "it comes no closer, 2.5 sd, 2 without it");
  EXPECT_THAT(WhyNoStep(without, {.rms_error = 2.5}), HasSubstr("it has no posterior and it"));
  EXPECT_NE(WhyNoStep(without, {.rms_error = std::numeric_limits<double>::quiet_NaN(),
                                .has_posterior = true}),
            "");
}

TEST(ImproveStep, EvidenceAgainstItOutweighsAFitThatIsALittleCloser) {
  const CalibratedModel without{
      .rms_error = 1.1, .has_posterior = true, .log_evidence = 100, .log_evidence_se = 0.3};
  CalibratedModel with{
      .rms_error = 1.0, .has_posterior = true, .log_evidence = 96, .log_evidence_se = 0.4};
  EXPECT_THAT(WhyNoStep(without, with), HasSubstr("the evidence is against it, by 4 ± 0.5"));
  with.log_evidence = 99.5;  // within two standard errors
  EXPECT_EQ(WhyNoStep(without, with), "");
  with.log_evidence = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(WhyNoStep(without, with), "");
  with = {.rms_error = 1.0};  // nothing to hold against it but that it is not known
  EXPECT_EQ(WhyNoStep(without, with), "");
}

TEST(ImproveStep, AnEffectThatMissesWhatIsLeftOutIsNoStep) {
  CalibratedModel without{.rms_error = 2, .has_posterior = true, .left_out_error = 2.5};
  CalibratedModel with{.rms_error = 1, .has_posterior = true, .left_out_error = 3};
  EXPECT_THAT(WhyNoStep(without, with), HasSubstr("left out of the fit, 3 sd, 2.5 without it"));
  with.left_out_error = 2.4;
  EXPECT_EQ(WhyNoStep(without, with), "");
  with.left_out_error = std::nullopt;
  EXPECT_EQ(WhyNoStep(without, with), "") << "not known, so nothing to hold against it";
  without.left_out_error = 0.7;
  with.left_out_error = 0.9;
  EXPECT_EQ(WhyNoStep(without, with), "") << "both as of a right model";
}

}  // namespace
}  // namespace calib::diagnosis
