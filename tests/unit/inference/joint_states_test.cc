#include "inference/filter/joint_states.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "inference/filter/iterative_filter.h"
#include "inference/mixture/dirichlet_mixture.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

// Two parameters, standard normal; counts of one and two in turn.
WeightedPoints Parameters(int n) {
  PhiloxStream stream({.seed = 4});
  WeightedPoints data{.points = Eigen::MatrixXd(2, n), .counts = Eigen::VectorXd(n)};
  for (int i = 0; i < n; ++i) {
    data.points.col(i) << stream.Normal(), stream.Normal();
    data.counts[i] = 1 + i % 2;
  }
  return data;
}

TEST(JoinStates, WhatIsLinearInTheParametersAddsNothing) {
  const WeightedPoints data = Parameters(50);
  const Eigen::MatrixXd states = data.points.transpose() * Eigen::MatrixXd::Random(2, 7);
  EXPECT_EQ(JoinStates(data, states).points, data.points);
  // Nor does anything with as few points as a regression has coefficients.
  EXPECT_EQ(JoinStates(Parameters(4), Eigen::MatrixXd::Random(4, 7)).points, Parameters(4).points);
}

// The same whether there are more samples than readings or fewer.
TEST(JoinStates, OneCoordinateForOneDirectionThatIsNotLinear) {
  for (const int readings : {7, 90}) {
    const WeightedPoints data = Parameters(50);
    Eigen::MatrixXd states = data.points.transpose() * Eigen::MatrixXd::Ones(2, readings);
    states.colwise() += data.points.row(0).transpose().cwiseAbs2();
    const WeightedPoints joint = JoinStates(data, states);
    ASSERT_EQ(joint.points.rows(), 3) << readings;
    EXPECT_EQ(joint.points.topRows(2), data.points);
    EXPECT_EQ(joint.counts, data.counts);
    const Eigen::VectorXd shares = data.counts / data.counts.sum();
    const Eigen::MatrixXd centred =
        (joint.points.colwise() - joint.points * shares) * shares.cwiseSqrt().asDiagonal();
    const Eigen::MatrixXd covariance = centred * centred.transpose();
    EXPECT_NEAR(covariance(2, 2), 0.5 * (covariance(0, 0) + covariance(1, 1)), 1e-12);
    EXPECT_NEAR(covariance(2, 0), 0, 1e-12);
    EXPECT_NEAR(covariance(2, 1), 0, 1e-12);
    // A linear function of the square, up to what is linear in the parameters.
    Eigen::MatrixXd regressors(50, 4);
    regressors << Eigen::VectorXd::Ones(50), data.points.transpose(),
        data.points.row(0).transpose().cwiseAbs2();
    const Eigen::VectorXd score = joint.points.row(2);
    EXPECT_LE((regressors * regressors.colPivHouseholderQr().solve(score) - score).norm(), 1e-10);
  }
}

// Samples of two populations of the parameter, N(-1, 1) and N(1, 1), a hundred each, whose runs
// take one of two branches that fit equally well. Their sum has one flat top; the states tell them
// apart.
class TwoBranches {
 public:
  explicit TwoBranches(std::uint64_t seed) {
    constexpr int kSamples = 200;
    Iteration iteration;
    iteration.parameters.resize(kSamples, 1);
    iteration.predictions.resize(kSamples, 2);
    iteration.log_proposal = Eigen::VectorXd(kSamples);
    PhiloxStream stream({.seed = seed});
    for (int i = 0; i < kSamples; ++i) {
      const double branch = i % 2 == 0 ? -1 : 1;
      const double x = branch + stream.Normal();
      iteration.parameters(i, 0) = x;
      iteration.predictions.row(i) << branch + 0.1 * stream.Normal(), 0;
      (*iteration.log_proposal)[i] = priors_[0].LogDensity(x);  // weights equal but for the branch
    }
    iterations_.push_back(std::move(iteration));
    data_.readings.push_back({.load_step = 0, .value = 0, .sd = 5});
    data_.readings.push_back({.load_step = 1, .value = 0, .sd = 5});
  }

  Proposal Fit(MixtureOver over) const {
    return FitProposal(priors_, data_, {.mixture = over, .seed = 1}, iterations_).value();
  }

  // Components that hold something, by their means.
  std::vector<MixtureComponent> Clusters(MixtureOver over) const {
    std::vector<MixtureComponent> found = Fit(over).components;
    std::erase_if(found, [](const auto& c) { return c.weight < 0.05; });
    std::sort(found.begin(), found.end(),
              [](const auto& a, const auto& b) { return a.mean[0] < b.mean[0]; });
    return found;
  }

  const JointPrior& priors() const { return priors_; }

 private:
  JointPrior priors_ = std::vector<Prior>{{.kind = PriorKind::kNormal, .mean = 0, .sd = 1}};
  DataSet data_;
  std::vector<Iteration> iterations_;
};

bool HasTwoHalves(const std::vector<MixtureComponent>& clusters) {
  return clusters.size() == 2 && std::abs(clusters[0].weight - clusters[1].weight) < 0.02;
}

TEST(TwoBranches, AreToldApartByParametersAndStatesNotByParameters) {
  constexpr int kSeeds = 8;
  int by_parameters = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const TwoBranches samples(seed);
    by_parameters += HasTwoHalves(samples.Clusters(MixtureOver::kParameters)) ? 1 : 0;
    const auto found = samples.Clusters(MixtureOver::kParametersAndStates);
    ASSERT_TRUE(HasTwoHalves(found)) << "seed " << seed;
    // Four standard errors of a hundred draws: 1 / sqrt(100) of a mean, sqrt(2 / 100) of a
    // variance.
    for (int k = 0; k < 2; ++k) {
      ASSERT_EQ(found[k].mean.size(), 1);
      EXPECT_NEAR(found[k].mean[0], 2 * k - 1, 0.4);
      EXPECT_NEAR(found[k].covariance(0, 0), 1, 0.57);
    }
  }
  EXPECT_LE(by_parameters, kSeeds / 4);
}

TEST(TwoBranches, SameSeedSameBits) {
  const TwoBranches samples(5);
  const Proposal a = samples.Fit(MixtureOver::kParametersAndStates);
  const Proposal b = samples.Fit(MixtureOver::kParametersAndStates);
  ASSERT_EQ(a.components.size(), b.components.size());
  for (std::size_t k = 0; k < a.components.size(); ++k) {
    EXPECT_EQ(a.components[k].weight, b.components[k].weight);
    EXPECT_EQ(a.components[k].mean, b.components[k].mean);
    EXPECT_EQ(a.components[k].covariance, b.components[k].covariance);
  }
  const FilterOptions options{.seed = 3};
  EXPECT_EQ(DrawSamples(a, samples.priors(), options, 1, 20).value(),
            DrawSamples(b, samples.priors(), options, 1, 20).value());
}

// The density of the first coordinate is the integral over the others.
TEST(MarginalOfFirst, IsTheIntegralOverTheOtherCoordinates) {
  Eigen::Matrix3d tilted;
  tilted << 1, 0.5, -0.3, 0.5, 2, 0.4, -0.3, 0.4, 0.5;
  const std::vector<MixtureComponent> joint{
      {.weight = 1, .mean = Eigen::Vector3d(0, 1, 2), .covariance = tilted},
      {.weight = 3,
       .mean = Eigen::Vector3d(2, -1, 1),
       .covariance = 0.3 * Eigen::Matrix3d::Identity()}};
  const GaussianMixture whole(joint);
  const GaussianMixture marginal(MarginalOfFirst(joint, 1));
  // The trapezoidal rule converges geometrically for Gaussians: steps of 0.2 sd and less.
  constexpr double kStep = 0.1;
  for (const double x : {-2.0, 0.3, 1.7, 4.0}) {
    double integral = 0;
    for (double y = -12; y <= 12; y += kStep) {
      for (double z = -8; z <= 8; z += kStep)
        integral += std::exp(whole.LogDensity(Eigen::Vector3d(x, y, z)));
    }
    const double density = std::exp(marginal.LogDensity(Eigen::VectorXd::Constant(1, x)));
    EXPECT_NEAR(integral * kStep * kStep, density, 1e-9) << x;
  }
}

}  // namespace
}  // namespace calib::inference
