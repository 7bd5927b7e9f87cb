#include <gtest/gtest.h>

#include <cmath>

#include "inference/evidence/importance_evidence.h"
#include "inference/evidence/model_probabilities.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/filter/tempering.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

TEST(LogWeights, SumSurvivesOverflowAndNothing) {
  EXPECT_NEAR(LogSumExp(Eigen::Vector3d(1000, 1000, -INFINITY)), 1000 + std::log(2), 1e-12);
  EXPECT_EQ(LogSumExp(Eigen::Vector2d(-INFINITY, -INFINITY)), -INFINITY);
  EXPECT_EQ(EffectiveSampleSize(Eigen::Vector2d(-INFINITY, -INFINITY)), 0);
}

TEST(LogWeights, EffectiveSampleSizeCountsEqualWeights) {
  EXPECT_NEAR(EffectiveSampleSize(Eigen::Vector4d(-5, -5, -INFINITY, -5)), 3, 1e-14);
  EXPECT_NEAR(EffectiveSampleSize(Eigen::Vector3d(0, -1e6, -1e6)), 1, 1e-14);
}

Eigen::VectorXd Parabola(int n) {
  return Eigen::VectorXd::NullaryExpr(n, [n](Eigen::Index i) {
    const double x = (static_cast<double>(i) + 0.5) / n - 0.5;
    return -1e4 * x * x;
  });
}

TEST(Tempering, HitsTheTargetExactly) {
  const Eigen::VectorXd start = Eigen::VectorXd::Zero(200);
  const Eigen::VectorXd log_likelihood = Parabola(200);
  for (const double target : {10.0, 40.0, 150.0}) {
    const Tempering found = FindExponent({.log_start = start,
                                          .log_likelihood = log_likelihood,
                                          .target = target,
                                          .max_exponent = INFINITY});
    EXPECT_TRUE(found.reached);
    EXPECT_NEAR(EffectiveSampleSize(found.exponent * log_likelihood), target, 1e-9 * target);
  }
}

TEST(Tempering, KeepsTheWholeLikelihoodWhereItLeavesEnoughSamples) {
  const Eigen::VectorXd start = Eigen::VectorXd::Zero(200);
  const Eigen::VectorXd log_likelihood = 1e-4 * Parabola(200);
  const Tempering found = FindExponent(
      {.log_start = start, .log_likelihood = log_likelihood, .target = 100, .max_exponent = 1});
  EXPECT_EQ(found.exponent, 1);
  EXPECT_TRUE(found.reached);
}

TEST(Tempering, OutOfReachTakesTheHighestHumpAndSaysSo) {
  // Starting weights peaked beside the likelihood: the ESS first rises as the likelihood evens them
  // out.
  Eigen::VectorXd start(200);
  for (int i = 0; i < 200; ++i) start[i] = 8 * i / 200.0;
  const Eigen::VectorXd log_likelihood = -start;
  const Tempering found = FindExponent({.log_start = start,
                                        .log_likelihood = log_likelihood,
                                        .target = 200.5,
                                        .max_exponent = INFINITY});
  EXPECT_FALSE(found.reached);
  EXPECT_NEAR(found.exponent, 1, 1e-5);
  EXPECT_NEAR(found.ess, 200, 1e-6);
}

TEST(Tempering, NeverIgnoresTheDataWhenTheSupremumIsAtExponentZero) {
  // The proposal prefers what the data prefer, so that the ESS grows all the way to exponent zero
  // and stays below 150.
  const Eigen::VectorXd start = 2e-3 * Parabola(200);
  ASSERT_LT(EffectiveSampleSize(start), 150);
  const Tempering found = FindExponent({.log_start = start,
                                        .log_likelihood = Parabola(200),
                                        .target = 150,
                                        .max_exponent = INFINITY});
  EXPECT_FALSE(found.reached);
  EXPECT_GT(found.exponent, 0);
  EXPECT_NEAR(found.ess, 0.75 * EffectiveSampleSize(start), 1e-6);
}

TEST(Tempering, NoSampleWithWeight) {
  const Eigen::VectorXd nothing = Eigen::VectorXd::Constant(3, -INFINITY);
  const Tempering found = FindExponent(
      {.log_start = nothing, .log_likelihood = nothing, .target = 1, .max_exponent = 1});
  EXPECT_FALSE(found.reached);
  EXPECT_EQ(found.ess, 0);
}

TEST(WeightedMoments, EqualWeightsGiveThePlainMoments) {
  Eigen::MatrixXd values(4, 2);
  values << 1e11 + 1, 1, 1e11 + 2, 3, 1e11 + 3, 2, 1e11 + 4, 6;
  const Eigen::VectorXd log_weights = Eigen::VectorXd::Constant(4, std::log(0.25));
  const Eigen::VectorXd mean = WeightedMean(log_weights, values);
  EXPECT_EQ(mean[0], 1e11 + 2.5);
  const Eigen::MatrixXd covariance = WeightedCovariance(log_weights, values, mean);
  EXPECT_NEAR(covariance(0, 0), 1.25, 1e-14);
  EXPECT_NEAR(covariance(0, 1), 1.75, 1e-14);
  EXPECT_NEAR(CorrelationOf(covariance)(1, 0), 1.75 / std::sqrt(1.25 * 3.5), 1e-14);
}

TEST(WeightedMoments, QuantilesInterpolateAndStopAtTheEnds) {
  const Eigen::VectorXd log_weights = Eigen::VectorXd::Constant(4, std::log(0.25));
  const Eigen::Vector4d values(4, 1, 3, 2);
  EXPECT_NEAR(WeightedQuantile(log_weights, values, 0.5), 2.5, 1e-14);
  EXPECT_EQ(WeightedQuantile(log_weights, values, 0.01), 1);
  EXPECT_EQ(WeightedQuantile(log_weights, values, 0.99), 4);
  EXPECT_EQ(WeightedQuantile(Eigen::Vector2d(0, -INFINITY), Eigen::Vector2d(7, -100), 0.05), 7);
}

TEST(ImportanceEvidence, StandardErrorIsTheDeltaMethod) {
  const Eigen::Vector4d weights(1, 2, 3, 6);
  const EvidenceEstimate estimate = ImportanceEvidence(weights.array().log());
  EXPECT_NEAR(estimate.log_evidence, std::log(3), 1e-14);
  const double variance = (4.0 + 1.0 + 0.0 + 9.0) / 3;
  EXPECT_NEAR(estimate.standard_error, std::sqrt(variance / 4) / 3, 1e-14);
}

// Exact generalised Pareto quantiles in place of draws: k comes back up to its shrinkage towards
// 1/2.
TEST(ParetoTail, ShapeOfAParetoSampleComesBack) {
  for (const double k : {-0.3, 0.2, 0.9}) {
    std::vector<double> x;
    constexpr int kN = 2000;
    for (int i = 0; i < kN; ++i) x.push_back((std::pow(1 - (i + 0.5) / kN, -k) - 1) / k);
    EXPECT_NEAR(GeneralizedParetoShape(x), k, 0.03);
  }
}

TEST(ParetoTail, WeightsOfATooNarrowProposalAreHeavyAndOfAWideOneLight) {
  // Target N(0, 1), proposal N(0, s): weights have index 1 - s^2... infinite variance below s^2 =
  // 1/2.
  const auto index = [](double s) {
    PhiloxStream stream({.seed = 9});
    Eigen::VectorXd log_weights(4000);
    for (double& w : log_weights) {
      const double x = s * stream.Normal();
      w = -0.5 * x * x + 0.5 * (x / s) * (x / s);
    }
    return ParetoTailIndex(log_weights);
  };
  EXPECT_GT(index(0.4), 0.7);
  EXPECT_LT(index(1.5), 0.3);
}

TEST(ParetoTail, EdgeCases) {
  EXPECT_EQ(ParetoTailIndex(Eigen::VectorXd::Zero(100)), 0);
  EXPECT_EQ(ParetoTailIndex(Eigen::VectorXd::Zero(10)), INFINITY);
  Eigen::VectorXd one = Eigen::VectorXd::Constant(100, -INFINITY);
  one[3] = 0;
  EXPECT_EQ(ParetoTailIndex(one), INFINITY);
}

TEST(ModelProbabilities, ExactEvidenceGivesTheRatioOfEvidences) {
  const std::vector<EvidenceEstimate> evidence = {{.log_evidence = -1000},
                                                  {.log_evidence = -1000 + std::log(3.0)}};
  const auto models = ModelProbabilities(evidence);
  ASSERT_EQ(models.size(), 2U);
  EXPECT_NEAR(models[0].probability, 0.25, 1e-12);
  EXPECT_NEAR(models[1].probability, 0.75, 1e-12);
  EXPECT_NEAR(models[0].q05, 0.25, 1e-12);
  EXPECT_NEAR(models[0].log_bayes_factor, -std::log(3.0), 1e-12);
  EXPECT_EQ(models[1].log_bayes_factor, 0);
  EXPECT_EQ(models[1].log_bayes_factor_se, 0);
}

TEST(ModelProbabilities, ErrorsOfTheEvidenceWidenTheProbabilities) {
  const std::vector<EvidenceEstimate> evidence = {{.log_evidence = 0, .standard_error = 0.6},
                                                  {.log_evidence = 1, .standard_error = 0.8}};
  const auto models = ModelProbabilities(evidence);
  EXPECT_NEAR(models[0].probability + models[1].probability, 1, 1e-12);
  EXPECT_NEAR(models[0].log_bayes_factor_se, 1, 1e-12);
  // The difference of the evidences is normal, mean 1 and sd 1: quantiles 1 -+ 1.645 through the
  // logistic function; 10 000 draws know them to about 0.01.
  EXPECT_NEAR(models[1].q05, 1 / (1 + std::exp(0.645)), 0.02);
  EXPECT_NEAR(models[1].q95, 1 / (1 + std::exp(-2.645)), 0.02);
  EXPECT_LT(models[1].probability, 1 / (1 + std::exp(-1.0))) << "less sure than without errors";
  EXPECT_GT(models[1].probability, 0.5);
}

}  // namespace
}  // namespace calib::inference
