// A test that the campaign does not have: its runs, and what a repeat is expected to tell.
#include "server/diagnosis/proposed_test.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// A hidden effect that another one is like, asked once.
class ProposedTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    toy_ = new RaceToy(3, 21, 48);
    view_ = new report::CampaignView(toy_->Measured({.effect = 0, .units = 1}, 4));
    auto chain = DesignChain::Create(*view_, {.without = RaceToy::Without()});
    ASSERT_TRUE(chain.ok()) << chain.status();
    EXPECT_FALSE(chain->Answered().ok()) << "there is no answer before the runs";
    ToyRunMaker maker(*toy_, chain->names());
    const auto answer = AnswerBy(*chain, maker);
    ASSERT_TRUE(answer.ok()) << answer.status();
    chain_ = new DesignChain(*std::move(chain));
  }
  static void TearDownTestSuite() {
    delete chain_;
    delete view_;
    delete toy_;
  }
  AnsweredDesign Answered() const { return *chain_->Answered(); }

  static inline RaceToy* toy_ = nullptr;
  static inline report::CampaignView* view_ = nullptr;
  static inline DesignChain* chain_ = nullptr;
};

TEST_F(ProposedTest, LeadingModelsHoldNinetyNinePercentAndTheirEffectsAreKnown) {
  const AnsweredDesign answered = Answered();
  const LeadingModels leading = LeadingOf(answered);
  double held = 0;
  for (const Index i : leading.models) {
    held += answered.asked->probabilities[0].model[i];
    for (const int k : answered.asked->space.models[static_cast<std::size_t>(i)].effects) {
      const int entry = answered.known->part.kept[static_cast<std::size_t>(k)];
      EXPECT_EQ(std::count(leading.part.kept.begin(), leading.part.kept.end(), entry), 1);
    }
  }
  EXPECT_TRUE(held >= 0.99 || leading.models.size() == 12);
}

TEST_F(ProposedTest, RowsHaveThePlaneOfTheBaseAndEveryLeadingEffect) {
  const AnsweredDesign answered = Answered();
  const LeadingModels leading = LeadingOf(answered);
  const BaseRuns& test = answered.before->base;
  const auto strengths = [&](const std::vector<campaign::RunOf>& rows) {
    std::vector<std::vector<double>> values;
    for (const campaign::RunOf& row : rows) values.push_back(row.values);
    return answered.known->rows.Points(values).strength;
  };
  const std::vector<campaign::RunOf> rows = RowsOfTest(answered, leading, test, 0);
  const Eigen::MatrixXd first = strengths(rows);
  EXPECT_EQ((first.array() == 0).rowwise().all().count(), 2 + 1 + 10);
  EXPECT_GE(first.rows(), 13 + kRunsOfTest);
  for (const int k : leading.part.kept) EXPECT_GE((first.col(k).array() != 0).count(), 2) << k;
  const auto made = static_cast<int>(rows.size());
  const std::vector<campaign::RunOf> further = RowsOfTest(answered, leading, test, made);
  EXPECT_EQ((strengths(further).array() == 0).rowwise().all().count(), 0);
  EXPECT_EQ(further.front().stream, rows.front().stream + made) << "on packings of their own";
  EXPECT_NE(further.front().values, rows[13].values) << "at other draws";
}

TEST_F(ProposedTest, ARepeatIsToldByItsOwnTestAndTellsLessThanItHasTo) {
  const AnsweredDesign answered = Answered();
  double bits = 0;
  for (const campaign::Experiment& experiment : view_->campaign.experiments) {
    const auto repeat = LearnRepeat(answered, view_->campaign, experiment.name);
    ASSERT_TRUE(repeat.ok()) << repeat.status();
    EXPECT_EQ(repeat->base.scale.curves().size(), 2U) << "the curves of one test of two";
    EXPECT_TRUE(repeat->holds);
    const auto forecast =
        ForecastOf(answered, {.set = repeat->known.set.get(), .measured = repeat->known.z});
    ASSERT_TRUE(forecast.ok()) << forecast.status();
    EXPECT_GE(forecast->information, -3 * forecast->error);
    EXPECT_GE(forecast->decided, forecast->named_right);
    bits = std::max(bits, forecast->information);
  }
  const Eigen::VectorXd& p = answered.asked->probabilities[0].model;
  const double entropy = -(p.array() * (p.array() + 1e-300).log()).sum();
  EXPECT_GT(bits, 0);
  EXPECT_LT(bits, entropy);
}

TEST(LeftOutHolds, IsWhetherIntervalsHoldWhatTheySay) {
  // Runs without chance beyond what is learnt hold; the same run twice as far off does not.
  Eigen::MatrixXd base(40, 1), y(40, 1);
  inference::PhiloxStream stream({.seed = 5, .iteration = 1, .sample = 1});
  for (Index i = 0; i < 40; ++i) {
    base(i, 0) = -1 + 2 * (static_cast<double>(i) + 0.5) / 40;
    y(i, 0) = base(i, 0) + stream.Normal();
  }
  const inference::EffectFeatures line(1, {}, 1);
  inference::EmulatorData data{
      .points = {.base = base, .strength = Eigen::MatrixXd(40, 0), .shape = Eigen::MatrixXd(40, 0)},
      .packing = std::vector<int>(40, 0),
      .outputs = y,
      .differences = {}};
  const auto good = inference::FeatureEmulator::Fit(line, data);
  ASSERT_TRUE(good.ok()) << good.status();
  EXPECT_TRUE(LeftOutHolds(*good));
  inference::EmulatorVariances sure = good->variances();
  sure.run /= 9;
  const auto wrong = inference::FeatureEmulator::Fit(line, data, {.start = sure, .hold = true});
  ASSERT_TRUE(wrong.ok()) << wrong.status();
  EXPECT_FALSE(LeftOutHolds(*wrong)) << "intervals a third as wide";
}

}  // namespace
}  // namespace calib::diagnosis
