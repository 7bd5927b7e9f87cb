// The emulator of runs with effects on: against dense Gaussian algebra, against runs that are
// really left out, and what the null must not change.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "inference/diagnosis/effect_features.h"
#include "inference/diagnosis/feature_emulator.h"
#include "inference/diagnosis/run_variance.h"
#include "tests/support/effects_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

TEST(EffectFeatures, DegreeIsWhatFourRunsACoefficientCarry) {
  EXPECT_EQ(EffectFeatures::DegreeFor(2, 96), 4);   // 15 terms
  EXPECT_EQ(EffectFeatures::DegreeFor(2, 59), 3);   // 10 terms
  EXPECT_EQ(EffectFeatures::DegreeFor(5, 96), 2);   // 21 terms
  EXPECT_EQ(EffectFeatures::DegreeFor(5, 224), 3);  // 56 terms
  EXPECT_EQ(EffectFeatures::DegreeFor(5, 23), 0);
}

TEST(EffectFeatures, CountsMonomialsAndBlocks) {
  const EffectFeatures features(2, {{.shapes = 1}, {.two_sided = true}}, 4);
  EXPECT_EQ(features.base_count(), 15);
  EXPECT_EQ(features.block(0).count, 6 + 5);
  EXPECT_EQ(features.block(1).count, 6);
  EXPECT_EQ(features.count(), 15 + 11 + 6);
  EXPECT_EQ(features.group_of().size(), static_cast<std::size_t>(features.count()));
}

TEST(EffectFeatures, DerivativesAreThoseOfDifferences) {
  const EffectFeatures features(3, {}, 3);
  const Eigen::MatrixXd base{{0.3, -0.7, 0.5}, {-0.2, 0.9, 0.1}};
  const double h = 1e-6;
  for (Index j = 0; j < 3; ++j) {
    Eigen::MatrixXd above = base, below = base;
    above.col(j).array() += h;
    below.col(j).array() -= h;
    const Eigen::MatrixXd difference = (features.Base(above) - features.Base(below)) / (2 * h);
    EXPECT_LT((features.BaseDerivative(base, j) - difference).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(EffectFeatures, BlocksAreZeroAtTheNullAndVarianceTermsCountPairs) {
  const EffectFeatures features(
      1, {{.power = 0.5, .shapes = 1}, {.two_sided = true}, {.calculated = true}}, 2);
  const DesignPoints points{.base = Eigen::MatrixXd{{0.5}, {0.5}},
                            .strength = Eigen::MatrixXd{{0, 0, 0}, {4, -3, 7}},
                            .shape = Eigen::MatrixXd{{0.9}, {0.9}}};
  const Eigen::MatrixXd all = features.All(points);
  EXPECT_EQ(all.row(0).tail(all.cols() - features.base_count()).cwiseAbs().maxCoeff(), 0);
  const Eigen::MatrixXd terms = features.VarianceTerms(points);
  EXPECT_EQ(terms.row(0).norm(), 0);
  EXPECT_NEAR(terms(1, 0), 4 + 9, 1e-12);  // f = 2 and -3; what is calculated does not scatter
  EXPECT_NEAR(terms(1, 1), 4 * 9, 1e-12);
}

class EffectEmulator : public ::testing::Test {
 protected:
  // Two parameters, three effects, six coordinates, 90 runs on 9 packings.
  CoordinateToy toy_{{.parameters = 2, .effects = 3, .coordinates = 6, .seed = 5}};
  EmulatorData data_ = toy_.Runs(50, 40, 9);
};

// Mean and variance of a new point, and of runs left out, from the joint normal law of everything:
// covariances of outputs by the same prior, with no feature's coefficient in sight.
TEST_F(EffectEmulator, IsDenseGaussianConditioning) {
  FeatureEmulatorOptions options{
      .run_variance = {.single = 0.1, .pair = 0.02}, .start = toy_.Variances(), .hold = true};
  const auto emulator = FeatureEmulator::Fit(toy_.features(), data_, options);
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  const DesignPoints at = toy_.Points(7, 2);
  const EmulatorPrediction prediction = emulator->Predict(at);

  const Eigen::MatrixXd f = toy_.features().All(data_.points);
  const Eigen::MatrixXd g = toy_.features().All(at);
  const Eigen::VectorXd tau = toy_.FeatureVariances();
  const Eigen::MatrixXd terms = toy_.features().VarianceTerms(data_.points);
  const Index n = f.rows();
  for (Index c = 0; c < 6; ++c) {
    Eigen::MatrixXd k = f * tau.asDiagonal() * f.transpose();
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        if (data_.packing[static_cast<std::size_t>(i)] ==
            data_.packing[static_cast<std::size_t>(j)])
          k(i, j) += toy_.Variances().packing;
      }
      k(i, i) += toy_.Variances().run[c] * (1 + 0.1 * terms(i, 0) + 0.02 * terms(i, 1));
    }
    const Eigen::MatrixXd inverse = k.inverse();
    const Eigen::MatrixXd cross = g * tau.asDiagonal() * f.transpose();
    const Eigen::VectorXd mean = cross * inverse * data_.outputs.col(c);
    const Eigen::VectorXd variance =
        (g * tau.asDiagonal() * g.transpose() - cross * inverse * cross.transpose()).diagonal();
    // The constant's prior variance of 1e4 costs four digits.
    EXPECT_LT((prediction.mean.col(c) - mean).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((prediction.variance.col(c) - variance).cwiseAbs().maxCoeff(), 1e-6);
    // Leave-one-out of a Gaussian process   [Rasmussen & Williams 2006, Eqs. 5.10-5.12]
    const Eigen::VectorXd alpha = inverse * data_.outputs.col(c);
    for (Index i = 0; i < n; ++i) {
      EXPECT_NEAR(emulator->left_out().error(i, c), alpha[i] / inverse(i, i), 1e-6);
      EXPECT_NEAR(emulator->left_out().variance(i, c), 1 / inverse(i, i), 1e-6);
    }
  }
}

TEST_F(EffectEmulator, NullEffectChangesNoBit) {
  const auto emulator = FeatureEmulator::Fit(toy_.features(), data_);
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  DesignPoints points = toy_.Points(20, 2);
  const EmulatorPrediction base = emulator->Predict(WithoutEffects(points));
  // Null in half of the rows only, so that the blocks of effects take part.
  for (Index i = 0; i < 20; i += 2) points.strength.row(i).setZero();
  const EmulatorPrediction some = emulator->Predict(points);
  for (Index i = 0; i < 20; i += 2) {
    EXPECT_EQ(base.mean.row(i), some.mean.row(i));
    EXPECT_EQ(base.variance.row(i), some.variance.row(i));
    EXPECT_EQ(some.added_run_variance[i], 0);
  }
  EXPECT_NE(base.mean.row(1), some.mean.row(1));
}

TEST_F(EffectEmulator, FindsTheVariancesThatRunsWereDrawnWith) {
  CoordinateToy toy({.parameters = 2, .effects = 3, .coordinates = 12, .seed = 8});
  const auto emulator = FeatureEmulator::Fit(toy.features(), toy.Runs(150, 150, 16));
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  // 12 coordinates of about 260 degrees of freedom: 2.5 % each of the mean.
  EXPECT_NEAR(emulator->variances().run.mean(), toy.Variances().run.mean(), 0.08);
  // 12 times 15 degrees of freedom: 11 %.
  EXPECT_NEAR(emulator->variances().packing, toy.Variances().packing, 0.33 * 0.3);
  EXPECT_NEAR(emulator->specimen().mean(), 1.0, 0.12);
  EXPECT_GT(emulator->freedom(), 15);
}

// Runs with effects on scatter more; runs of the same model without the term do not.
TEST_F(EffectEmulator, FindsHowMuchMoreRunsWithEffectsScatter) {
  CoordinateToy::Options options{.parameters = 2, .effects = 3, .coordinates = 12, .seed = 11};
  CoordinateToy plain(options);
  options.run_variance = {.single = 0.1, .pair = 0};
  CoordinateToy wider(options);
  const auto none = FitWithRunVariance(plain.features(), plain.Runs(100, 120, 16));
  const auto some = FitWithRunVariance(wider.features(), wider.Runs(100, 120, 16));
  ASSERT_TRUE(none.ok() && some.ok());
  EXPECT_LE(none->run_variance().single, 0.01);
  EXPECT_LE(none->run_variance().pair, 0.01);
  EXPECT_GE(some->run_variance().single + some->run_variance().pair, 0.03);
  EXPECT_LE(some->run_variance().single, 0.3);
}

TEST_F(EffectEmulator, LearnsCalculatedEffectsFromDifferencesAlone) {
  CoordinateToy toy({.parameters = 2, .effects = 3, .coordinates = 6, .seed = 5, .calculated = 1});
  EmulatorData data = toy.Runs(50, 40, 9);
  data.points.strength.col(2).setZero();
  data.outputs = toy.Outputs(data.points, data.packing);
  const auto without = FeatureEmulator::Fit(toy.features(), data);
  EXPECT_THAT(without.status().message(), HasSubstr("effect 2 is on in 0 runs"));
  data.differences = toy.Differences(data.points, 2, 30);
  const auto emulator = FeatureEmulator::Fit(toy.features(), data);
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  const CalculatedDifferences fresh = toy.Differences(toy.Points(20, 0), 2, 20);
  const Eigen::MatrixXd predicted =
      emulator->PredictMean(fresh.with) - emulator->PredictMean(fresh.without);
  EXPECT_GT(fresh.outputs.cwiseAbs().mean(), 0.5);
  EXPECT_LT((predicted - fresh.outputs).cwiseAbs().mean(), 0.1);
}

TEST_F(EffectEmulator, RealisationsSpreadAsTheVarianceSays) {
  const auto emulator = FeatureEmulator::Fit(toy_.features(), data_);
  ASSERT_TRUE(emulator.ok());
  const DesignPoints at = toy_.Points(5, 2);
  const EmulatorPrediction prediction = emulator->Predict(at);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(5, 6), squares = sum;
  const int n = 2000;
  for (int r = 0; r < n; ++r) {
    const Eigen::MatrixXd mean =
        emulator->MeanOf(emulator->Realisation(3, static_cast<std::uint64_t>(r)), at);
    sum += mean - prediction.mean;
    squares += (mean - prediction.mean).cwiseAbs2();
  }
  for (Index i = 0; i < 5; ++i) {
    for (Index c = 0; c < 6; ++c) {
      const double sd = std::sqrt(prediction.variance(i, c));
      EXPECT_LT(std::abs(sum(i, c) / n), 4 * sd / std::sqrt(n));
      EXPECT_NEAR(squares(i, c) / n / (sd * sd), 1, 4 * std::sqrt(2.0 / n));
    }
  }
}

TEST_F(EffectEmulator, SaysWhatItLacks) {
  EmulatorData few = data_;
  for (Index i = 1; i < few.points.rows(); ++i) few.points.strength(i, 1) = 0;
  EXPECT_THAT(FeatureEmulator::Fit(toy_.features(), few).status().message(),
              HasSubstr("effect 1 is on in"));
  EmulatorData broken = data_;
  broken.outputs(3, 2) = std::nan("");
  EXPECT_THAT(FeatureEmulator::Fit(toy_.features(), broken).status().message(),
              HasSubstr("not finite"));
}

// A shape parameter is an input: what the effect does turns with it, and where the effect is off it
// does nothing.
TEST(EffectShapes, AreLearnedFromRunsThatVaryThem) {
  const EffectFeatures features(1, {{.shapes = 1}}, 2);
  EmulatorData data;
  CoordinateToy random({.seed = 9});
  const Index n = 80;
  const auto truth = [](double x, double s, double t) {
    return Eigen::RowVector2d(2 * x + s * (1 + t), 0.5 * x * x - s * t * t);
  };
  data.points = {.base = Eigen::MatrixXd(n, 1),
                 .strength = Eigen::MatrixXd::Zero(n, 1),
                 .shape = Eigen::MatrixXd(n, 1)};
  data.outputs.resize(n, 2);
  for (Index i = 0; i < n; ++i) {
    data.points.base(i, 0) = 2 * random.Uniform() - 1;
    data.points.strength(i, 0) = i % 2 == 0 ? 0 : 0.4 + 3 * random.Uniform();
    data.points.shape(i, 0) = 2 * random.Uniform() - 1;
    data.outputs.row(i) =
        truth(data.points.base(i, 0), data.points.strength(i, 0), data.points.shape(i, 0)) +
        0.3 * random.Normal(1, 2).row(0);
    data.packing.push_back(7);  // one packing: its departure is in every run, and in no variance
  }
  const auto emulator = FeatureEmulator::Fit(features, data);
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  EXPECT_EQ(emulator->specimen(), emulator->variances().run);
  EXPECT_NEAR(std::sqrt(emulator->specimen().mean()), 0.3, 0.05);
  for (const double t : {-0.8, 0.0, 0.7}) {
    const DesignPoints at{.base = Eigen::MatrixXd{{0.3}},
                          .strength = Eigen::MatrixXd{{2}},
                          .shape = Eigen::MatrixXd::Constant(1, 1, t)};
    const EmulatorPrediction p = emulator->Predict(at);
    for (Index c = 0; c < 2; ++c)
      EXPECT_LT(std::abs(p.mean(0, c) - truth(0.3, 2, t)[c]), 3.5 * std::sqrt(p.variance(0, c)));
    DesignPoints off = at;
    off.strength(0, 0) = 0;
    EXPECT_EQ(emulator->PredictMean(off)(0, 0), emulator->PredictMean(WithoutEffects(at))(0, 0));
  }
}

TEST(EffectShapes, CubeOfAModelHoldsParametersStrengthsAndShapes) {
  ModelSpace space{.effects = {{.shapes = 1}, {.two_sided = true, .shapes = 2}}};
  space.strength.assign(2, {.low = 0.5, .high = 8, .negative_low = 0.25, .negative_high = 4});
  space.shape_low = Eigen::Vector3d(-1, -1, 0);
  space.shape_high = Eigen::Vector3d(0.3, 1, 2);
  space.base_low = Eigen::Vector2d(-1, 10);
  space.base_high = Eigen::Vector2d(1, 20);
  space.models = AllModels(2, {});
  ASSERT_TRUE(space.Validate().ok());
  EXPECT_EQ(SignsOf(space, {.effects = {0, 1}}).size(), 2u);
  const ModelCube cube(space, {.effects = {1}}, {-1});
  ASSERT_EQ(cube.dimensions(), 2 + 1 + 2);
  const DesignPoints points = cube.Points(Eigen::MatrixXd{{0.5, 0.1, 0.5, 0.25, 0.75}});
  EXPECT_NEAR(points.base(0, 0), 0, 1e-12);
  EXPECT_NEAR(points.base(0, 1), 11, 1e-12);
  EXPECT_EQ(points.strength(0, 0), 0);
  EXPECT_NEAR(points.strength(0, 1), -1, 1e-12);  // the middle of 0.25 and 4 in logarithms
  EXPECT_EQ(points.shape(0, 0), 0);
  EXPECT_NEAR(points.shape(0, 1), -0.5, 1e-12);
  EXPECT_NEAR(points.shape(0, 2), 1.5, 1e-12);
}

}  // namespace
}  // namespace calib::inference
