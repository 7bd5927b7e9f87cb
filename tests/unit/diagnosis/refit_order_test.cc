// Which effects are refitted, and which refit the next batch of runs goes to.
#include "server/diagnosis/refit_order.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace calib::diagnosis {
namespace {

constexpr double kBase = 400;  // chi-squared of the model without any of the effects
constexpr double kUnknown = std::numeric_limits<double>::infinity();

TEST(PriceOf, AFitThatIsNotFoundYetIsWorthWhatTheScreenExpects) {
  const double poor_but_promising = PriceOf(3 * kBase, kBase, 0.2, 3);
  const double near_but_hopeless = PriceOf(0.8 * kBase, kBase, 0.95, 3);
  EXPECT_LT(poor_but_promising, near_but_hopeless);
}

TEST(PriceOf, WhatHasBeenReachedCountsWhereItIsMore) {
  EXPECT_LT(PriceOf(10, kBase, 0.9, 3), PriceOf(200, kBase, 0.9, 3));
}

TEST(PriceOf, NoPromiseMakesAFitWorseThanTheModelItContains) {
  EXPECT_EQ(PriceOf(kUnknown, kBase, 5, 2), PriceOf(kBase, kBase, 1, 2));
}

TEST(PriceOf, EveryBatchHasToPay) {
  EXPECT_LT(PriceOf(kBase, kBase, 0.5, 2), PriceOf(kBase, kBase, 0.5, 3));
  EXPECT_GT(PriceOf(kBase, kBase, 0.5, 6), PriceOf(kBase, kBase, 1, 3));
}

CandidateEffect Seen(const std::string& effect, double p_value, double explained,
                     std::vector<std::string> confusable_with = {}) {
  CandidateEffect candidate;
  candidate.effect = effect;
  candidate.p_value = p_value;
  candidate.explained_fraction = explained;
  candidate.predicted_rms_error = 1;
  candidate.confusable_with = std::move(confusable_with);
  return candidate;
}

class OrderOfRefitsTest : public testing::Test {
 protected:
  OrderOfRefitsTest() {
    diagnosis_.rms = 2;
    diagnosis_.adequacy.p_value = 1e-4;
    diagnosis_.candidates = {Seen("adhesion_jkr", 1e-3, 0.4),
                             Seen("adhesion_dmt", 2e-3, 0.5),
                             Seen("rolling_resistance", 3e-3, 0.3, {"twisting_resistance"}),
                             Seen("twisting_resistance", 4e-3, 0.6, {"rolling_resistance"}),
                             Seen("membrane_stiffness", 0.2, 0.1),
                             Seen("contact_plasticity", 0.3, 0.2),
                             Seen("viscous_damping", 0.5, 0),
                             Seen("linear_cohesion", 1, 0.1),
                             Seen("initial_density", 1, 0.2)};
  }
  RefitOrder Order() const { return OrderOfRefits(diagnosis_, {}, 0.01); }
  static std::vector<std::string> Names(const std::vector<RefitOrder::Later>& later) {
    std::vector<std::string> names;
    for (const auto& one : later) names.push_back(one.effect + (one.hinted ? " hinted" : ""));
    return names;
  }
  Diagnosis diagnosis_;
};

TEST_F(OrderOfRefitsTest, OneOfEachKindBegins) {
  EXPECT_EQ(Order().first, (std::vector<std::string>{"adhesion_jkr", "rolling_resistance",
                                                     "membrane_stiffness", "contact_plasticity"}));
}

TEST_F(OrderOfRefitsTest, TheOthersFollowByWhatTheyPromiseAndTheStoodForAtLast) {
  EXPECT_EQ(Names(Order().later),
            (std::vector<std::string>{"initial_density", "linear_cohesion",
                                      "twisting_resistance hinted", "adhesion_dmt hinted"}));
}

TEST_F(OrderOfRefitsTest, OnlyHintsAreFollowedWhereNothingIsMissingForCertain) {
  diagnosis_.adequacy.p_value = 0.05;
  EXPECT_EQ(Names(Order().later),
            (std::vector<std::string>{"twisting_resistance hinted", "adhesion_dmt hinted"}));
}

class NextRefitTest : public OrderOfRefitsTest {
 protected:
  static RefitStanding At(const std::string& effect, double chi2, double batches = 2) {
    return {.effect = effect,
            .chi2 = chi2,
            .batches = batches,
            .stalled = false,
            .explains = chi2 < 60};
  }
  static RefitStanding Stalled(const std::string& effect, double chi2) {
    RefitStanding refit = At(effect, chi2, 5);
    refit.stalled = true;
    return refit;
  }
  std::string Next(const std::vector<RefitStanding>& begun, bool may_begin = true) const {
    return NextRefit(order_, begun, kBase, may_begin).value_or("");
  }
  // Each promises what the others do.
  RefitOrder order_ = {.first = {"a", "b", "c", "d"},
                       .later = {{"e", false}, {"f", true}},
                       .alike = {{"a", {"b"}}, {"b", {"a"}}},
                       .promised = {{"e", 0.8}}};
};

TEST_F(NextRefitTest, AFitThatComesCloseGoesOnBeforeAnotherIsBegun) {
  EXPECT_EQ(Next({At("a", 100), At("b", 300), At("c", 390), At("d", 390)}), "a");
}

TEST_F(NextRefitTest, AnotherIsBegunBeforeThoseThatComeNoCloserGoOn) {
  EXPECT_EQ(Next({At("a", 380), At("b", 390), At("c", 390), At("d", 390)}), "e");
  EXPECT_EQ(Next({At("a", 380), At("b", 390), At("c", 390), At("d", 390)}, false), "a");
}

TEST_F(NextRefitTest, RunsThatDivergedMakeAFitNoDearer) {
  const RefitStanding b = Stalled("b", 390);
  EXPECT_EQ(Next({At("a", 150, 3), b, b, b}), "e");
  EXPECT_EQ(Next({At("a", 150, 13.0 / 6), b, b, b}), "a") << "3 batches of 6, 5 runs diverged";
}

TEST_F(NextRefitTest, AFitThatExplainsLeavesItsRunsToTheOthers) {
  EXPECT_EQ(Next({At("a", 50), At("b", 390), At("c", 390), At("d", 390)}), "e");
  EXPECT_EQ(Next({At("a", 50), At("b", 390), At("c", 390), At("d", 390)}, false), "b");
}

TEST_F(NextRefitTest, ThreeThatAreNotAlikeAreEnough) {
  EXPECT_EQ(Next({At("a", 50), At("b", 50), At("c", 50), Stalled("d", 390)}), "e");
  EXPECT_EQ(Next({At("a", 50), Stalled("b", 390), At("c", 50), At("d", 50)}), "f");
  EXPECT_EQ(Next({At("a", 50), At("c", 50), At("d", 50), At("f", 390)}), "f");
}

TEST_F(NextRefitTest, WhatIsLikeAnEffectThatExplainsIsBegunFirst) {
  order_.alike = {{"a", {"f"}}, {"f", {"a"}}};
  EXPECT_EQ(Next({At("a", 50), At("b", 100), At("c", 390), At("d", 390)}), "f");
  EXPECT_EQ(Next({At("a", 380), At("b", 390), At("c", 390), At("d", 390)}), "e");
}

TEST_F(NextRefitTest, TheBestOfThoseThatExplainGoesOnLast) {
  EXPECT_EQ(Next({At("a", 40), At("b", 50), Stalled("c", 390)}, false), "b");
  EXPECT_EQ(Next({At("a", 40), Stalled("b", 50), Stalled("c", 390)}, false), "a");
  EXPECT_EQ(Next({Stalled("a", 40), Stalled("b", 50)}, false), "");
}

}  // namespace
}  // namespace calib::diagnosis
