#include "server/diagnosis/verdict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

namespace calib::diagnosis {
namespace {

constexpr int kReadings = 40;
constexpr double kLevel = 0.01;
constexpr double kAway = 400;  // chi2 of a model that is plainly wrong
constexpr double kClose = 40;  // of one that is right

// A model that can do one thing, with residuals of one size.
inference::FittedModel Model(double chi2) {
  inference::FittedModel model;
  const double size = std::sqrt(chi2 / static_cast<double>(kReadings));
  model.histories = Eigen::MatrixXd::Constant(1, kReadings, size);
  model.covariance.setIdentity(kReadings, kReadings);
  model.parameters = 2;
  return model;
}

class VerdictTest : public testing::Test {
 protected:
  VerdictTest() {
    diagnosis_.left_out_error = 3;
    diagnosis_.adequacy.chi2 = kAway;
  }

  // A refit, at its end unless told otherwise.
  WarmFit& Refit(const std::string& effect, double chi2, double explained = 0.9) {
    WarmFit fit;
    fit.stalled = true;
    fit.iterations = 4;
    fit.chi2_after = {kAway, kAway, chi2, chi2};
    fit.runs.histories = Eigen::MatrixXd::Zero(1, kReadings);
    fit.model = Model(chi2);
    fit.adequacy = *inference::TestAdequacy(fit.model);
    fit.over_base = *inference::Compare(fit.model, base_);
    fit.left_out_error = 1;
    CandidateEffect& candidate = diagnosis_.candidates.emplace_back();
    candidate.effect = effect;
    candidate.campaign = "c" + effect;
    candidate.refit_chi2 = chi2;
    candidate.explained_fraction = explained;
    return fits_[effect] = fit;
  }

  const std::string& Concluded(bool base_fits = false) {
    Verdict(diagnosis_, fits_, base_, kLevel).Conclude(base_fits);
    return diagnosis_.verdict;
  }

  using Names = std::vector<std::string>;
  const Names& Group() const { return diagnosis_.candidates.front().confusable_with; }

  inference::FittedModel base_ = Model(kAway);
  std::map<std::string, WarmFit> fits_;
  Diagnosis diagnosis_;
};

TEST_F(VerdictTest, NothingToAddToAModelThatFits) { EXPECT_EQ(Concluded(true), "adequate"); }

TEST_F(VerdictTest, NothingThatExplainsAModelThatDoesNotFit) {
  Refit("rolling", 0.9 * kAway);
  EXPECT_EQ(Concluded(), "unexplained");
  EXPECT_EQ(diagnosis_.best_partial, "");  // no clear step
  EXPECT_EQ(diagnosis_.reason,
            "with none of the 1 effects that were refitted does it fit, and none comes clearly "
            "closer: rolling lowers chi-squared to 90 %, clearly is below 64 %");
  EXPECT_EQ(diagnosis_.effect, "");
}

TEST_F(VerdictTest, PartOfAMisfitIsSaid) {
  Refit("rolling", 0.5 * kAway);
  Refit("twisting", 0.4 * kAway);
  EXPECT_EQ(Concluded(), "unexplained");
  EXPECT_EQ(diagnosis_.best_partial, "twisting");
}

TEST_F(VerdictTest, TheOnlyOneThatExplainsIsNamed) {
  Refit("rolling", kClose);
  Refit("twisting", 0.5 * kAway);
  EXPECT_EQ(Concluded(), "missing_effect");
  EXPECT_EQ(diagnosis_.effect, "rolling");
}

// All the misfit in one stage of loading: the bootstrap over blocks of readings knows no more than
// one of them.
TEST_F(VerdictTest, AMisfitInOneStageThatGoesIsExplained) {
  for (const bool beyond_doubt : {true, false}) {
    diagnosis_ = {};
    diagnosis_.adequacy.p_value = beyond_doubt ? 1e-50 : 1e-3;
    Refit("plasticity", kClose, 0.95);
    diagnosis_.adequacy.chi2 = kAway;
    fits_["plasticity"].over_base = {.nats = 0.46 * kAway, .sd = kAway};
    EXPECT_EQ(Concluded(), beyond_doubt ? "missing_effect" : "unexplained");
    // Adequate since the emulator knows little: by the base model's errors it is not near.
    fits_["plasticity"].over_base.nats = 0.4 * kAway;
    diagnosis_.effect = "";
    EXPECT_EQ(Concluded(), "unexplained");
  }
}

TEST_F(VerdictTest, TwoThatDoAsWellAreNamedTogether) {
  Refit("rolling", kClose);
  Refit("twisting", 1.05 * kClose);
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(diagnosis_.effect, "");
  EXPECT_EQ(Group(), Names{"twisting"});
}

// On two sides of the level, and nearer to each other than chance: half of the readings are closer
// to the one, half to the other.
TEST_F(VerdictTest, ARefitJustBeyondTheLevelIsNotClearlyWorse) {
  Refit("rolling", 60);
  WarmFit& twisting = Refit("twisting", 64);
  Eigen::VectorXd residuals = Eigen::VectorXd::Constant(kReadings, std::sqrt(1.0 / kReadings));
  for (int k = 0; k < kReadings; ++k) residuals(k) *= std::sqrt(64.0) * (k % 2 == 0 ? 0.4 : 1.357);
  twisting.model.histories = residuals.transpose();
  twisting.adequacy = *inference::TestAdequacy(twisting.model);
  ASSERT_LT(twisting.adequacy.p_value, kLevel);
  ASSERT_GT(fits_["rolling"].adequacy.p_value, kLevel);
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(Group(), Names{"twisting"});
  EXPECT_EQ(diagnosis_.unfinished, Names{}) << "it has come to its end";
}

TEST_F(VerdictTest, NoMoreThanThreeAreNamed) {
  for (const char* name : {"a", "b", "c", "d"}) Refit(name, kClose);
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(Group(), (Names{"b", "c"}));
}

TEST_F(VerdictTest, ARefitThatHasNotEndedIsNotExcluded) {
  Refit("rolling", kClose);
  Refit("twisting", 3 * kClose, 0.8).stalled = false;
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(Group(), Names{"twisting"});
  EXPECT_EQ(diagnosis_.unfinished, Names{"twisting"});
}

TEST_F(VerdictTest, ARefitThatIsFarOffAndPromisedLessIsExcluded) {
  Refit("rolling", kClose);
  Refit("twisting", 5 * kClose, 0.5).stalled = false;
  EXPECT_EQ(Concluded(), "missing_effect");
}

TEST_F(VerdictTest, ARefitThatCameNoCloserThanTheBaseModelIsJudgedByTheScreen) {
  Refit("twisting", kClose);
  Refit("rolling", 2 * kAway, 0).stalled = false;
  diagnosis_.candidates[0].screen_explained = 0.8;
  diagnosis_.candidates[1].screen_explained = 0.9;
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(diagnosis_.unfinished, Names{"rolling"});
  diagnosis_.candidates.front().confusable_with.clear();
  diagnosis_.candidates[1].screen_explained = 0.3;
  EXPECT_EQ(Concluded(), "missing_effect");
}

TEST_F(VerdictTest, ARefitIsComparedWithTheBestAfterAsManyBatches) {
  Refit("rolling", kClose).chi2_after = {kAway, kAway, kAway, 1.5 * kClose, kClose, kClose};
  WarmFit& slow = Refit("twisting", 0.9 * kAway, 0.1);
  slow.stalled = false;
  slow.chi2_after = {kAway, 0.9 * kAway, 0.9 * kAway};
  EXPECT_EQ(Concluded(), "missing_effect") << "the best was close after one batch more";
  diagnosis_.candidates.front().confusable_with.clear();
  slow.chi2_after.pop_back();
  EXPECT_EQ(Concluded(), "ambiguous") << "after three the best was no closer";
}

TEST_F(VerdictTest, OneThatTheScreenCannotTellFromItComesBeforeOneThatExplainsLess) {
  for (const double angle : {5.0, 40.0}) {
    diagnosis_ = {};
    diagnosis_.adequacy.chi2 = kAway;
    Refit("adhesion", kClose);
    Refit("jkr", 1.01 * kClose);
    Refit("twisting", 1.3 * kClose);
    diagnosis_.candidates.front().confusable_with = {"capillary"};
    diagnosis_.candidates.front().angles = {{"capillary", angle}};
    EXPECT_EQ(Concluded(), "ambiguous");
    EXPECT_EQ(Group(), (Names{"jkr", angle < 25 ? "capillary" : "twisting"}));
  }
}

TEST_F(VerdictTest, WhatTheScreenCannotTellFromItIsNamedUnlessItWasFitted) {
  Refit("rolling", kClose);
  Refit("twisting", 0.5 * kAway);
  diagnosis_.candidates.front().confusable_with = {"twisting", "membrane"};
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(Group(), Names{"membrane"});
}

TEST_F(VerdictTest, WhatTheScreenHasRefutedIsNotNamedForItsAngle) {
  Refit("damping", kClose);
  diagnosis_.candidates.front().screen_explained = 1;
  diagnosis_.candidates.front().confusable_with = {"cohesion"};
  diagnosis_.candidates.emplace_back().effect = "cohesion";
  EXPECT_EQ(Concluded(), "missing_effect");
}

TEST_F(VerdictTest, ARefitThatEndedWithoutBeingFoundIsJudgedByTheScreen) {
  Refit("rolling", kClose);
  WarmFit& lost = Refit("twisting", 2 * kAway, 0);  // at its end
  lost.adequacy = WarmFit().adequacy;
  diagnosis_.candidates[0].screen_explained = 0.8;
  for (const bool judged : {true, false}) {
    diagnosis_.candidates[0].confusable_with.clear();
    diagnosis_.unfinished.clear();
    if (judged) lost.adequacy = *inference::TestAdequacy(lost.model);
    diagnosis_.candidates[1].screen_explained = 0.7;
    EXPECT_EQ(Concluded(), "ambiguous") << judged;
    EXPECT_EQ(diagnosis_.unfinished, Names{"twisting"});
    diagnosis_.candidates[0].confusable_with.clear();
    diagnosis_.candidates[1].screen_explained = 0.3;
    EXPECT_EQ(Concluded(), "missing_effect") << judged;
    lost.adequacy = WarmFit().adequacy;
  }
}

TEST_F(VerdictTest, OneThatTheScreenSawAndNobodyRefittedIsNotExcluded) {
  Refit("rolling", kClose);
  CandidateEffect& other = diagnosis_.candidates.emplace_back();
  other.effect = "capillary";
  other.p_value = 1e-9;
  other.screen_explained = 0.9;
  diagnosis_.candidates.front().screen_explained = 0.8;
  EXPECT_EQ(Concluded(), "ambiguous");
  EXPECT_EQ(diagnosis_.unfinished, Names{"capillary"});
  diagnosis_.candidates.front().confusable_with.clear();
  diagnosis_.candidates[1].p_value = 0.3;
  EXPECT_EQ(Concluded(), "missing_effect");
  diagnosis_.candidates[1].p_value = 1e-9;
  diagnosis_.candidates[1].screen_explained = 0.5;
  EXPECT_EQ(Concluded(), "missing_effect");
}

// Not one of its runs has come to an end.
TEST_F(VerdictTest, ARefitWithoutRunsExplainsNothing) {
  diagnosis_.adequacy.p_value = 1e-50;
  WarmFit none;
  none.stalled = true;
  none.iterations = 1;
  fits_["crushing"] = none;
  CandidateEffect& candidate = diagnosis_.candidates.emplace_back();
  candidate.effect = "crushing";
  candidate.campaign = "c9";
  candidate.refit_chi2 = none.adequacy.chi2;
  candidate.explained_fraction = 1;  // as the screen says
  EXPECT_EQ(Concluded(), "unexplained");
  EXPECT_EQ(diagnosis_.best_partial, "");
  EXPECT_EQ(diagnosis_.reason, "no effect could be refitted");
}

TEST_F(VerdictTest, AnErrorOfOneSdOnDataLeftOutIsAsExpected) {
  diagnosis_.left_out_error = 0.98;
  Refit("adhesion", kClose).left_out_error = 0.99;
  EXPECT_EQ(Concluded(), "missing_effect");
  fits_["adhesion"].left_out_error = 1.2;
  EXPECT_EQ(Concluded(), "unexplained");
}

TEST_F(VerdictTest, AFitThatPredictsOtherReadingsWorseExplainsNothing) {
  Refit("rolling", kClose).left_out_error = 4;
  EXPECT_EQ(Concluded(), "unexplained");
  EXPECT_NE(
      diagnosis_.reason.find("with rolling it fits (p = 0.38), but is not clearly better than "
                             "without: it misses data it was not fitted to by 4 sd, 3 without"),
      std::string::npos)
      << diagnosis_.reason;
}

TEST_F(VerdictTest, AGainThatChanceGivesExplainsNothing) {
  Refit("rolling", kClose).gain_p_value = 0.6 * kLevel;
  EXPECT_EQ(Concluded(), "missing_effect");
  Refit("twisting", 0.9 * kAway);  // one of two refits
  EXPECT_EQ(Concluded(), "unexplained");
}

TEST_F(VerdictTest, AHintThatHangsOnThePriorOfItsStrengthIsNone) {
  base_ = Model(55);
  Refit("rolling", kClose).over_base = {.nats = 8, .sd = 1};
  diagnosis_.candidates.front().over_base_evidence =
      ScaledEvidence{.log_evidence = {2, 1, -1}, .standard_error = 0};
  EXPECT_EQ(Concluded(true), "adequate");
  diagnosis_.candidates.front().over_base_evidence->log_evidence = {3, 2, 1};
  EXPECT_EQ(Concluded(true), "missing_effect");
}

TEST_F(VerdictTest, AWorseFitThatEvidenceDoesNotOutweighStaysInTheGroup) {
  WarmFit& rolling = Refit("rolling", 20);
  Refit("twisting", 50);  // adequate, clearly worse
  ScaledEvidence evidence{.log_evidence = {9, 9, 9}, .standard_error = 0};
  rolling.evidence = evidence;
  EXPECT_EQ(Concluded(), "ambiguous");  // twisting's is not known
  diagnosis_.candidates.front().confusable_with.clear();
  evidence.log_evidence = {1, 1, 9};
  fits_["twisting"].evidence = evidence;
  EXPECT_EQ(Concluded(), "ambiguous");  // not for every width
  diagnosis_.candidates.front().confusable_with.clear();
  fits_["twisting"].evidence->log_evidence = {1, 1, 1};
  fits_["twisting"].evidence->standard_error = 5;
  EXPECT_EQ(Concluded(), "ambiguous") << "within two standard errors";
  diagnosis_.candidates.front().confusable_with.clear();
  fits_["twisting"].evidence->standard_error = 3;
  EXPECT_EQ(Concluded(), "missing_effect");
}

}  // namespace
}  // namespace calib::diagnosis
