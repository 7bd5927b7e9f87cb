// Which runs and which measurement would tell models apart: cases whose answer is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <vector>

#include "inference/diagnosis/next_measurement.h"
#include "inference/diagnosis/next_runs.h"
#include "tests/support/effects_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

// One parameter, two effects at known strength, coefficients as told. An emulator of many runs, so
// that it is sure of what it says.
class EffectDesign : public ::testing::Test {
 protected:
  CoordinateToy toy_{{.parameters = 1, .effects = 2, .coordinates = 4, .seed = 12}};
  DiagnosisSet set_ = [this] {
    auto emulator = FeatureEmulator::Fit(toy_.features(), toy_.Runs(40, 24, 8),
                                         {.start = toy_.Variances(), .hold = true});
    EXPECT_TRUE(emulator.ok()) << emulator.status();
    SpecimenErrors errors{.specimen = emulator->specimen(),
                          .run = emulator->variances().run,
                          .noise = Eigen::VectorXd::Constant(4, 0.2),
                          .staging = Eigen::MatrixXd(4, 0),
                          .share = 1,
                          .freedom = std::numeric_limits<double>::infinity()};
    return DiagnosisSet(*std::move(emulator), std::move(errors));
  }();

  DesignPoints Point(double base, double first, double second) const {
    return {.base = Eigen::MatrixXd{{base}},
            .strength = Eigen::MatrixXd{{first, second}},
            .shape = Eigen::MatrixXd(1, 0)};
  }
  // Two models, each sure of its point, equally probable.
  std::vector<ModelEvidence> Two(const DesignPoints& a, const DesignPoints& b) const {
    std::vector<ModelEvidence> result(2);
    result[0].model.effects = {0};
    result[0].draws = a;
    result[1].model.effects = {1};
    result[1].draws = b;
    return result;
  }
  EffectProbabilities Even() const {
    return {.model = Eigen::Vector2d(0.5, 0.5),
            .inclusion = Eigen::Vector2d(0.5, 0.5),
            .share = Eigen::Vector2d(0.5, 0.5),
            .inclusion_sd = Eigen::Vector2d::Zero()};
  }
};

// ln 2 - E[H(posterior)] of two normal laws of one covariance at distance d: by quadrature along
// the line that joins them.
double InformationOfTwo(double d) {
  double result = 0;
  const int n = 4000;
  for (int i = 0; i < n; ++i) {
    const double x = -8 + (16 + d) * (i + 0.5) / n;
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI);
    const double odds = std::exp(-0.5 * (x - d) * (x - d) + 0.5 * x * x);
    result += (16 + d) / n * density * (std::log(2) - std::log1p(odds));
  }
  return result;
}

TEST_F(EffectDesign, ExpectedInformationOfTwoPointsIsThatOfQuadrature) {
  const DesignPoints a = Point(0.1, 1, 0), b = Point(0.1, 0, 1);
  const auto found =
      ExpectedInformation({.set = &set_}, Two(a, b), Even(), {.measurements = 4000, .seed = 3});
  ASSERT_TRUE(found.ok()) << found.status();
  const EmulatorPrediction x = set_.emulator().Predict(a), y = set_.emulator().Predict(b);
  const Eigen::VectorXd own = set_.errors().specimen + set_.errors().noise;
  // The emulator's variances at the two points differ by little: their mean is meant.
  const Eigen::VectorXd v = own + 0.5 * (x.variance.row(0) + y.variance.row(0)).transpose();
  const double d =
      std::sqrt(((x.mean - y.mean).row(0).transpose().array().square() / v.array()).sum());
  EXPECT_GT(d, 1);
  EXPECT_NEAR(found->information, InformationOfTwo(d), 4 * found->error + 0.02);
  EXPECT_LE(found->information, std::log(2));
}

TEST_F(EffectDesign, SameModelTwiceTellsNothing) {
  const DesignPoints a = Point(0.1, 1, 0);
  const auto found = ExpectedInformation({.set = &set_}, Two(a, a), Even());
  ASSERT_TRUE(found.ok());
  EXPECT_NEAR(found->information, 0, 1e-9);
  EXPECT_EQ(found->named_right, 0);
  const auto runs = NextRuns({&set_, Eigen::VectorXd::Zero(4)}, Two(a, a), Even(), a, {.runs = 2});
  ASSERT_TRUE(runs.ok());
  EXPECT_NEAR(runs->information[1], 0, 1e-9);
}

// Where the base model may be the right one, it is told by a measurement too, and no effect named.
TEST_F(EffectDesign, TheBaseModelIsAnAnswerToo) {
  std::vector<ModelEvidence> models = Two(Point(0.1, 8, 0), Point(0.1, 0, 0));
  models[1].model.effects.clear();
  EffectProbabilities even = Even();
  even.inclusion = even.share = Eigen::Vector2d(0.5, 0);
  const auto found = ExpectedInformation({.set = &set_}, models, even);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_NEAR(found->named_right, 0.5, 0.05);
  EXPECT_GT(found->decided, 0.95);
}

// Models with an effect that the test's emulator does not know take no part in what it tells.
TEST_F(EffectDesign, ATestOfFewerEffectsTellsItsOwnModelsApart) {
  CoordinateToy other({.parameters = 1, .effects = 1, .coordinates = 4, .seed = 5});
  auto emulator = FeatureEmulator::Fit(other.features(), other.Runs(40, 24, 8),
                                       {.start = other.Variances(), .hold = true});
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  SpecimenErrors errors = set_.errors();
  errors.specimen = emulator->specimen();
  const DiagnosisSet one(*std::move(emulator), std::move(errors));
  const ProposedMeasurement proposed{.set = &one, .columns = PointColumns{.strength = {0}}};
  const auto alone = ExpectedInformation(proposed, Two(Point(0.1, 3, 0), Point(0.1, 0, 3)), Even());
  ASSERT_TRUE(alone.ok()) << alone.status();
  EXPECT_NEAR(alone->information, 0, 1e-12);
  EXPECT_THAT(ExpectedInformation({.set = &one}, Two(Point(0.1, 3, 0), Point(0.1, 0, 3)), Even())
                  .status()
                  .message(),
              HasSubstr("other parameters"));
}

// A repeat has the errors of the emulator once more: it tells less than the same tests would whose
// emulator errs independently.
TEST_F(EffectDesign, RepeatSharesTheEmulatorsErrors) {
  const DesignPoints a = Point(0.1, 3, 0), b = Point(0.1, 0, 3);
  const Eigen::VectorXd between =
      0.5 * (set_.emulator().PredictMean(a) + set_.emulator().PredictMean(b)).row(0);
  const ForecastOptions options{.measurements = 2000, .seed = 3};
  const auto fresh = ExpectedInformation({.set = &set_}, Two(a, b), Even(), options);
  const auto repeat =
      ExpectedInformation({.set = &set_, .measured = between}, Two(a, b), Even(), options);
  ASSERT_TRUE(fresh.ok() && repeat.ok());
  EXPECT_GT(repeat->information, 0);
  EXPECT_LT(repeat->information, fresh->information);
}

// Two models explain z by bending the emulator at their own points: runs there tell which had to
// bend; runs where the emulator knows, tell nothing.
TEST_F(EffectDesign, NextRunsGoWhereModelsDisagreeAndTheEmulatorIsNotSure) {
  const DesignPoints a = Point(0.2, 4, 0), b = Point(0.2, 0, 4);
  const Eigen::VectorXd z =
      set_.emulator().PredictMean(a).row(0).transpose() + Eigen::Vector4d(2, -2, 1.5, -1.5);
  DesignPoints candidates{.base = Eigen::MatrixXd{{0.2}, {0.2}, {0.2}, {-0.5}},
                          .strength = Eigen::MatrixXd{{0, 0}, {4, 0}, {0, 4}, {0.4, 0}},
                          .shape = Eigen::MatrixXd(4, 0)};
  const auto runs = NextRuns({&set_, z}, Two(a, b), Even(), candidates, {.runs = 3});
  ASSERT_TRUE(runs.ok()) << runs.status();
  EXPECT_TRUE(runs->rows[0] == 1 || runs->rows[0] == 2);
  EXPECT_GT(runs->information[0], 0);
  EXPECT_GT(runs->information[1], runs->information[0]);
  EXPECT_GT(runs->information[2], runs->information[1]);
  EXPECT_LT(runs->information[2], std::log(2));
  // Against the base runs alone.
  const auto base = NextRuns({&set_, z}, Two(a, b), Even(), RowsOf(candidates, {0}), {.runs = 1});
  ASSERT_TRUE(base.ok());
  EXPECT_LT(base->information[0], 0.3 * runs->information[0]);
}

TEST_F(EffectDesign, BatchesAreChosenTheSameForTheSameInput) {
  const DesignPoints a = Point(0.2, 4, 0), b = Point(0.2, 0, 4);
  const DesignPoints candidates = toy_.Points(40, 2);
  const MeasuredSet measured{&set_, Eigen::Vector4d(1, 2, -1, 0)};
  const auto once = NextRuns(measured, Two(a, b), Even(), candidates);
  const auto again = NextRuns(measured, Two(a, b), Even(), candidates);
  ASSERT_TRUE(once.ok() && again.ok());
  EXPECT_EQ(once->rows, again->rows);
  EXPECT_EQ(once->rows.size(), 6u);
}

TEST_F(EffectDesign, RefusesWhatDoesNotFit) {
  const DesignPoints a = Point(0.2, 4, 0);
  EXPECT_THAT(NextRuns({&set_, Eigen::VectorXd::Zero(3)}, Two(a, a), Even(), a).status().message(),
              HasSubstr("do not fit"));
  std::vector<ModelEvidence> none(2);
  EXPECT_THAT(ExpectedInformation({.set = &set_}, none, Even()).status().message(),
              HasSubstr("no model has posterior draws"));
}

}  // namespace
}  // namespace calib::inference
