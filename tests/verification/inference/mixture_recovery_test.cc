// The Dirichlet-process mixture finds a known mixture again, from plain and from weighted samples.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "inference/mixture/dirichlet_mixture.h"

namespace calib::inference {
namespace {

const std::vector<MixtureComponent>& Truth() {
  static const std::vector<MixtureComponent> truth = [] {
    Eigen::Matrix2d tilted;
    tilted << 0.4, -0.3, -0.3, 0.5;
    return std::vector<MixtureComponent>{
        {.weight = 0.6, .mean = Eigen::Vector2d(0, 0), .covariance = tilted},
        {.weight = 0.4,
         .mean = Eigen::Vector2d(4, 1),
         .covariance = 0.2 * Eigen::Matrix2d::Identity()}};
  }();
  return truth;
}

// Of 500 draws (or as many as 400 counts stand for) the standard errors are sqrt(0.24 / 500) =
// 0.022 of a weight, sqrt(trace C / 300) = 0.055 of the larger component's mean, and some 0.05 of
// its covariance (entries of 0.5 times sqrt(2 / 300), three of them): limits of about three.
void ExpectTruth(const std::vector<MixtureComponent>& found) {
  ASSERT_EQ(found.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(found[k].weight, Truth()[k].weight, 0.06);
    EXPECT_LE((found[k].mean - Truth()[k].mean).norm(), 0.15);
    EXPECT_LE((found[k].covariance - Truth()[k].covariance).norm(), 0.15);
  }
}

WeightedPoints Draws(int n) {
  const GaussianMixture mixture(Truth());
  PhiloxStream stream({.seed = 6});
  WeightedPoints data{.points = Eigen::MatrixXd(2, n), .counts = Eigen::VectorXd::Ones(n)};
  for (int i = 0; i < n; ++i) data.points.col(i) = mixture.Draw(stream);
  return data;
}

TEST(MixtureRecovery, TwoComponentsFromDraws) {
  const auto fit = FitDirichletMixture(Draws(500), {.seed = 1});
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_TRUE(fit->converged);
  ExpectTruth(fit->PlugIn(0.01));
}

// Uniform points weighted by the density stand for draws of it.
TEST(MixtureRecovery, TwoComponentsFromWeightedPoints) {
  const GaussianMixture mixture(Truth());
  PhiloxStream stream({.seed = 7});
  constexpr int kN = 4000;
  WeightedPoints data{.points = Eigen::MatrixXd(2, kN), .counts = Eigen::VectorXd(kN)};
  for (int i = 0; i < kN; ++i) {
    data.points.col(i) = Eigen::Vector2d(-3 + 9 * stream.Uniform(), -3 + 7 * stream.Uniform());
    data.counts[i] = std::exp(mixture.LogDensity(data.points.col(i)));
  }
  data.counts *= 400 / data.counts.sum();
  const auto fit = FitDirichletMixture(data, {.seed = 1});
  ASSERT_TRUE(fit.ok()) << fit.status();
  ExpectTruth(fit->PlugIn(0.01));
}

// Coordinate ascent never lowers the complete bound (without a covariance floor, which is outside
// the model).
TEST(MixtureRecovery, CompleteBoundNeverFalls) {
  const WeightedPoints data = Draws(200);
  Eigen::MatrixXd start = Eigen::MatrixXd::Zero(200, 5);
  for (int i = 0; i < 200; ++i) start(i, i % 5) = 1;
  double before = -INFINITY;
  for (int iterations = 1; iterations < 60; iterations += 3) {
    const DirichletMixture fit = FitFrom(data,
                                         {.max_components = 5,
                                          .covariance_floor = 0,
                                          .tolerance = 1e-300,
                                          .max_iterations = iterations},
                                         start);
    const double bound = EvidenceLowerBound(data, fit.prior, fit.state);
    EXPECT_GE(bound, before - 1e-8);
    before = bound;
  }
}

TEST(MixtureRecovery, SamplesOnALineAreRefused) {
  WeightedPoints data{.points = Eigen::MatrixXd::Zero(2, 10), .counts = Eigen::VectorXd::Ones(10)};
  for (int i = 0; i < 10; ++i) data.points(0, i) = i;
  EXPECT_EQ(FitDirichletMixture(data, {}).status().code(), absl::StatusCode::kFailedPrecondition);
  data.counts.setConstant(0.01);
  EXPECT_EQ(FitDirichletMixture(data, {}).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(FitDirichletMixture(data, {.restarts = 0}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace calib::inference
