// From probabilities to verdict, levels, families and words.
#include "server/diagnosis/answer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::diagnosis {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Base, each entry alone, the first two together, none of these.
AnswerParts PartsOf(const std::vector<std::string>& effect_of, const Eigen::VectorXd& model,
                    double adequacy_p) {
  const auto k = static_cast<Eigen::Index>(effect_of.size());
  AnswerParts parts{.effect_of = effect_of, .models = {{}}};
  for (int e = 0; e < k; ++e) parts.models.push_back({.effects = {e}});
  parts.models.push_back({.effects = {0, 1}});
  parts.models.push_back({.effects = {}, .none_of_these = true});
  inference::EffectProbabilities p{.model = model,
                                   .inclusion = Eigen::VectorXd::Zero(k),
                                   .share = Eigen::VectorXd::Zero(k),
                                   .adequate = model[0],
                                   .none_of_these = model[k + 2],
                                   .inclusion_sd = Eigen::VectorXd::Constant(k, 0.01)};
  for (int e = 0; e < k; ++e) p.inclusion[e] = model[e + 1] + (e < 2 ? model[k + 1] : 0);
  parts.widths = {p};
  parts.beyond = {Eigen::VectorXd::Zero(k)};
  parts.angles = Eigen::MatrixXd::Constant(k, k, 80);
  parts.angles.diagonal().setZero();
  parts.adequacy_p = adequacy_p;
  parts.chance.assign(parts.models.size(), 0.5);
  parts.chance[0] = adequacy_p;
  parts.chance.back() = 0;
  return parts;
}

Answer Said(const AnswerParts& parts) {
  const auto answer = AnswerFrom(parts);
  EXPECT_TRUE(answer.ok()) << answer.status();
  return answer.ok() ? *answer : Answer();
}

const std::vector<std::string> kThree = {"rolling", "cohesion", "plasticity"};

TEST(Answer, NamesWhatIsProbableEnoughWhateverTheAdequacyTestSays) {
  Eigen::VectorXd model(6);
  model << 0.01, 0.97, 0.005, 0.005, 0.005, 0.005;
  for (const double p : {0.4, 1e-6}) {
    const Answer answer = Said(PartsOf(kThree, model, p));
    EXPECT_EQ(answer.verdict, AnswerVerdict::kMissingEffect);
    EXPECT_THAT(answer.effects, ElementsAre("rolling"));
    EXPECT_FALSE(answer.sure);
    EXPECT_EQ(answer.sentence,
              "Missing: rolling, 98 %, or something alike that this library lacks.");
    ASSERT_EQ(answer.credible_set.size(), 1u);
    EXPECT_EQ(answer.candidates.front().effect, "rolling");
    EXPECT_TRUE(answer.candidates.front().alone);
  }
}

TEST(Answer, SumsToOneAndSaysWhoIsInTheSet) {
  Eigen::VectorXd model(6);
  model << 0.02, 0.5, 0.45, 0.01, 0.01, 0.01;
  const Answer answer = Said(PartsOf(kThree, model, 1e-5));
  double sum = 0;
  for (const NamedModel& own : answer.probabilities) sum += own.probability;
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAmbiguous);
  EXPECT_THAT(answer.effects, IsEmpty());
  ASSERT_EQ(answer.credible_set.size(), 2u);
  EXPECT_THAT(answer.credible_set[0].effects, ElementsAre("rolling"));
  EXPECT_EQ(answer.sentence,
            "One of these two, 95 %: rolling or cohesion; which of them, these tests cannot tell.");
}

// Where the chance that it names one is worth telling.
TEST(Answer, ASecondSpecimenIsSpokenOfWhereItWouldTell) {
  Eigen::VectorXd model(6);
  model << 0.02, 0.5, 0.45, 0.01, 0.01, 0.01;
  Answer answer = Said(PartsOf(kThree, model, 1e-5));
  answer.repeat_names_alone = 0.42;
  EXPECT_EQ(VerdictInWords(answer),
            "One of these two, 95 %: rolling or cohesion; which of them, these tests cannot tell; "
            "on a second specimen they would, with probability 42 %.");
  answer.repeat_names_alone = 0.01;
  EXPECT_THAT(VerdictInWords(answer), EndsWith("these tests cannot tell."));
}

// Of many models the first three are said, after a family that is sure.
TEST(Answer, OfALongSetTheFamilyIsSaidFirst) {
  const std::vector<std::string> six = {"a", "b", "c", "d", "e", "f"};
  Eigen::VectorXd model(9);
  model << 0.02, 0.3, 0.28, 0.2, 0.1, 0.05, 0.03, 0.01, 0.01;
  AnswerParts parts = PartsOf(six, model, 1e-5);
  EXPECT_EQ(Said(parts).sentence,
            "One of these six, 96 %: a, b, c and 3 more; which of them, these tests cannot tell.");
  parts.kin = {{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}, {0, 4}, {1, 4}, {2, 4}, {3, 4}};
  EXPECT_THAT(Said(parts).sentence, HasSubstr("and 3 more")) << "no family is sure";
  parts.kin.insert(parts.kin.end(), {{0, 5}, {1, 5}, {2, 5}, {3, 5}, {4, 5}});
  EXPECT_EQ(Said(parts).sentence,
            "a, b, c, d, e or f acts, 97 %: a, b, c and 3 more; which of them, these tests cannot "
            "tell.");
}

TEST(Answer, PairsAreNamedTogetherOrNot) {
  Eigen::VectorXd model(6);
  model << 0.001, 0.004, 0.004, 0.001, 0.988, 0.002;
  EXPECT_THAT(Said(PartsOf(kThree, model, 1e-5)).effects, ElementsAre("rolling", "cohesion"));
  // The second effect is not sure.
  model << 0.001, 0.3, 0.004, 0.001, 0.692, 0.002;
  const Answer answer = Said(PartsOf(kThree, model, 1e-5));
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAmbiguous);
  EXPECT_TRUE(answer.candidates.front().alone) << "the first one is, in all of them";
}

TEST(Answer, NoneOfTheseAndNobodyAdequateAreUnexplained) {
  Eigen::VectorXd model(6);
  model << 0.01, 0.2, 0.1, 0.03, 0.03, 0.63;
  Answer answer = Said(PartsOf(kThree, model, 1e-6));
  EXPECT_EQ(answer.verdict, AnswerVerdict::kUnexplained);
  EXPECT_THAT(answer.sentence, StartsWith("None of these, 63 %"));
  model << 0.01, 0.6, 0.2, 0.03, 0.06, 0.1;
  AnswerParts parts = PartsOf(kThree, model, 1e-6);
  parts.chance.assign(parts.models.size(), 1e-4);
  answer = Said(parts);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kUnexplained);
  EXPECT_THAT(answer.sentence, HasSubstr("No model of the race"));
  // The adequacy test decides the word where no effect is named.
  parts.adequacy_p = 0.3;
  answer = Said(parts);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAdequate);
  EXPECT_THAT(answer.sentence, HasSubstr("Yet rolling is more probable (60 %)"));
  model << 0.01, 0.6, 0.35, 0.01, 0.02, 0.01;
  parts = PartsOf(kThree, model, 0.3);
  parts.kin = {{0, 1}};
  EXPECT_THAT(Said(parts).sentence, EndsWith("Yet rolling or cohesion acts, 97 %."));
}

TEST(Answer, WhatIsBeyondTheDesignOrNotVerifiedIsNotNamed) {
  Eigen::VectorXd model(6);
  model << 0.001, 0.99, 0.001, 0.002, 0.003, 0.003;
  AnswerParts parts = PartsOf(kThree, model, 1e-6);
  parts.beyond[0][0] = 0.4;
  Answer answer = Said(parts);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAmbiguous);
  EXPECT_EQ(answer.candidates.front().not_named, inference::NotNamed::kBeyondDesign);
  EXPECT_THAT(answer.sentence, HasSubstr("the measurement lies outside what the runs reach"));
  parts.beyond[0][0] = 0;
  parts.verified = true;  // others were
  parts.verification = {{"cohesion", 0.5}};
  EXPECT_EQ(Said(parts).candidates.front().not_named, inference::NotNamed::kVerification);
  parts.verification["rolling"] = 0.3;
  EXPECT_THAT(Said(parts).effects, ElementsAre("rolling"));
}

TEST(Answer, StrengthsOfOneEffectAreOneEffect) {
  Eigen::VectorXd model(6);
  model << 0.01, 0.4, 0.3, 0.02, 0.26, 0.01;
  const Answer answer = Said(PartsOf({"load_cell", "load_cell", "other"}, model, 1e-6));
  EXPECT_EQ(answer.verdict, AnswerVerdict::kMissingEffect);
  EXPECT_THAT(answer.effects, ElementsAre("load_cell"));
  EXPECT_EQ(answer.candidates.size(), 2u);
  EXPECT_NEAR(answer.candidates[0].probability, 0.96, 1e-12);
  EXPECT_NEAR(answer.probabilities[0].probability, 0.96, 1e-12);
}

// An effect under two names is never named, and is a family.
TEST(Answer, AFamilyIsSaidWhereNoNameIs) {
  Eigen::VectorXd model(6);
  model << 0.005, 0.49, 0.48, 0.005, 0.01, 0.01;
  AnswerParts parts = PartsOf(kThree, model, 1e-6);
  parts.angles(0, 1) = parts.angles(1, 0) = 3;
  Answer answer = Said(parts);
  EXPECT_THAT(answer.effects, IsEmpty());
  ASSERT_EQ(answer.families.size(), 1u);
  EXPECT_THAT(answer.families[0].effects, ElementsAre("rolling", "cohesion"));
  EXPECT_NEAR(answer.families[0].probability, 0.98, 1e-12);
  // Or by the catalogue.
  parts.angles(0, 1) = parts.angles(1, 0) = 80;
  EXPECT_THAT(Said(parts).families, IsEmpty());
  parts.kin = {{0, 1}};
  EXPECT_EQ(Said(parts).families.size(), 1u);
}

TEST(Answer, RefusesPartsThatDoNotFit) {
  Eigen::VectorXd model(6);
  model << 0.5, 0.1, 0.1, 0.1, 0.1, 0.1;
  AnswerParts parts = PartsOf(kThree, model, 0.5);
  parts.chance.pop_back();
  EXPECT_FALSE(AnswerFrom(parts).ok());
}

}  // namespace
}  // namespace calib::diagnosis
