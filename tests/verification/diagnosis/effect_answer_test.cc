// What the answer says, and what it may not: a name for one of two that are alike, or for what lies
// beyond the design.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <utility>
#include <vector>

#include "inference/diagnosis/effect_probabilities.h"
#include "inference/diagnosis/model_evidence.h"
#include "inference/diagnosis/visible_strength.h"
#include "tests/support/effects_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using ::testing::ElementsAre;

// An effect under two names: nothing tells them apart.
TEST(EffectAnswer, DuplicatedEffectIsSharedAndNeverNamed) {
  CoordinateToy single({.parameters = 1, .effects = 2, .coordinates = 5, .seed = 30, .main = 4});
  const EmulatorData half = single.Runs(30, 40, 5);
  // Effect 2 is effect 0 once more: its runs are those of effect 0.
  std::vector<DesignEffect> effects = single.features().effects();
  effects.push_back(effects[0]);
  const EffectFeatures features(1, effects, 2);
  EmulatorData data = half;
  const Index n = half.points.rows();
  data.points.base = half.points.base.replicate(2, 1);
  data.points.shape = Eigen::MatrixXd(2 * n, 0);
  data.points.strength = Eigen::MatrixXd::Zero(2 * n, 3);
  data.points.strength.topLeftCorner(n, 2) = half.points.strength;
  data.points.strength.block(n, 1, n, 1) = half.points.strength.col(1);
  data.points.strength.block(n, 2, n, 1) = half.points.strength.col(0);
  data.outputs = half.outputs.replicate(2, 1);
  data.packing.insert(data.packing.end(), half.packing.begin(), half.packing.end());
  auto emulator = FeatureEmulator::Fit(features, data);
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  SpecimenErrors errors{.specimen = emulator->specimen(),
                        .run = emulator->variances().run,
                        .noise = Eigen::VectorXd::Constant(5, 0.2),
                        .staging = Eigen::MatrixXd(5, 0),
                        .share = 1,
                        .freedom = 20};
  const DiagnosisSet set(*std::move(emulator), std::move(errors));
  ModelSpace space = ToySpace(single);
  space.effects = effects;
  space.strength.resize(3, space.strength[0]);
  space.models = AllModels(3, {{0, 2}});
  const DesignPoints truth{.base = Eigen::MatrixXd{{0.1}},
                           .strength = Eigen::MatrixXd{{4, 0, 0}},
                           .shape = Eigen::MatrixXd(1, 0)};
  const Eigen::VectorXd z = set.emulator().PredictMean(truth).row(0);
  const auto evidence = ModelEvidences({{&set, z}}, space);
  ASSERT_TRUE(evidence.ok());
  const auto p = ProbabilitiesOf(*evidence, space);
  ASSERT_TRUE(p.ok());
  EXPECT_GT(p->inclusion[0] + p->inclusion[2], 0.95);
  EXPECT_NEAR(p->inclusion[0], p->inclusion[2], 0.05);  // two sampling errors of 0.02 each
  const Eigen::MatrixXd angles =
      SignatureAngles({&set}, truth.base.row(0), Eigen::Vector3d(2, 2, 2));
  EXPECT_LT(angles(0, 2), 1);
  const std::vector<std::vector<int>> families = Families(angles, {});
  const auto answer = AnswerOf({.widths = {*p},
                                .beyond = {Eigen::Vector3d::Zero()},
                                .families = families,
                                .verification = Eigen::Vector3d::Ones()},
                               space.models);
  ASSERT_TRUE(answer.ok());
  EXPECT_THAT(answer->alone, ElementsAre());
  ASSERT_EQ(answer->families.size(), 1u);
  EXPECT_THAT(answer->families[0].effects, ElementsAre(0, 2));
  EXPECT_GE(answer->set.size(), 2u);
}

// What is beyond the design is not named, and neither is what one prior alone makes probable.
TEST(EffectAnswer, BeyondTheDesignNothingIsNamed) {
  CoordinateToy toy({.parameters = 1, .effects = 2, .coordinates = 5, .seed = 31, .main = 4});
  const EmulatorData data = toy.Runs(40, 60, 6);
  const DiagnosisSet set = SetOf(toy, data, 20);
  ModelSpace space = ToySpace(toy, 30);
  const DesignRange range = RangeOf(data.points);
  EXPECT_LE(range.strength_high[0], 5);
  const auto answer_at = [&](double strength) {
    const DesignPoints truth{.base = Eigen::MatrixXd{{0.1}},
                             .strength = Eigen::MatrixXd{{strength, 0}},
                             .shape = Eigen::MatrixXd(1, 0)};
    const Eigen::VectorXd z = toy.Mean(truth).row(0);
    const auto evidence = ModelEvidences({{&set, z}}, space);
    EXPECT_TRUE(evidence.ok());
    const auto p = ProbabilitiesOf(*evidence, space);
    EXPECT_TRUE(p.ok());
    EXPECT_GT(p->inclusion[0], 0.95) << strength;
    return AnswerOf({.widths = {*p},
                     .beyond = {BeyondDesign(*evidence, *p, range)},
                     .families = {{0}, {1}},
                     .verification = Eigen::Vector2d::Ones()},
                    space.models);
  };
  const auto inside = answer_at(2.5), outside = answer_at(7);
  ASSERT_TRUE(inside.ok() && outside.ok());
  EXPECT_THAT(inside->alone, ElementsAre(0));
  EXPECT_THAT(outside->alone, ElementsAre());
  ASSERT_EQ(outside->not_named.size(), 1u);
  EXPECT_EQ(outside->not_named[0].second, NotNamed::kBeyondDesign);
}

EffectProbabilities Stated(const Eigen::Vector4d& model) {
  // Base, effect 0, effect 1, none.
  return {.model = model,
          .inclusion = model.segment(1, 2),
          .share = model.segment(1, 2),
          .adequate = model[0],
          .none_of_these = model[3],
          .inclusion_sd = Eigen::Vector2d::Zero()};
}

TEST(EffectAnswer, LevelsAreThoseStated) {
  const std::vector<EffectModel> models = {
      {}, {.effects = {0}}, {.effects = {1}}, {.none_of_these = true}};
  AnswerBasis basis{.widths = {Stated({0.01, 0.97, 0.01, 0.01})},
                    .beyond = {Eigen::Vector2d::Zero()},
                    .families = {{0, 1}},
                    .verification = Eigen::Vector2d::Ones()};
  auto answer = AnswerOf(basis, models);
  ASSERT_TRUE(answer.ok());
  EXPECT_THAT(answer->alone, ElementsAre(0));
  EXPECT_FALSE(answer->sure);  // below 0.99
  EXPECT_EQ(answer->set.size(), 1u);
  EXPECT_NEAR(answer->families.at(0).probability, 0.98, 1e-12);

  basis.verification[0] = 0.001;
  answer = AnswerOf(basis, models);
  EXPECT_THAT(answer->alone, ElementsAre());
  EXPECT_EQ(answer->not_named.at(0).second, NotNamed::kVerification);

  basis.verification[0] = 1;
  basis.widths.push_back(Stated({0.02, 0.94, 0.02, 0.02}));
  basis.beyond.emplace_back(Eigen::Vector2d::Zero());
  answer = AnswerOf(basis, models);
  EXPECT_THAT(answer->alone, ElementsAre());
  EXPECT_EQ(answer->not_named.at(0).second, NotNamed::kOtherPrior);

  basis.widths = {Stated({0.1, 0.2, 0.1, 0.6})};
  basis.beyond.resize(1);
  answer = AnswerOf(basis, models);
  EXPECT_TRUE(answer->unexplained);
  EXPECT_EQ(answer->set.size(), 4u);
  EXPECT_EQ(answer->set[0].effect, CredibleEntry::kNoneOfThese);
}

TEST(EffectAnswer, FamiliesHoldOnlyPairsThatAreAlike) {
  // 0 and 1, 1 and 2 are alike, 0 and 2 are not; 3 is kin of 2.
  const Eigen::MatrixXd angles{{0, 15, 40, 80}, {15, 0, 20, 80}, {40, 20, 0, 80}, {80, 80, 80, 0}};
  const auto families = Families(angles, {{2, 3}});
  EXPECT_THAT(families, ElementsAre(ElementsAre(0, 1), ElementsAre(2, 3)));
}

}  // namespace
}  // namespace calib::inference
