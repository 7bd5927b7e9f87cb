#include "inference/scatter/shrunk_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kPathReadings = 30;

Eigen::VectorXd Smooth() {
  Eigen::VectorXd v(kPathReadings);
  for (Index k = 0; k < kPathReadings; ++k) {
    v[k] = std::sin(std::numbers::pi * (static_cast<double>(k) + 0.5) / kPathReadings);
  }
  return v.normalized();
}

Eigen::MatrixXd Chain() {
  Eigen::MatrixXd chain(kPathReadings, kPathReadings);
  for (Index i = 0; i < kPathReadings; ++i) {
    for (Index j = 0; j < kPathReadings; ++j) {
      chain(i, j) = std::exp(-static_cast<double>(std::abs(i - j)) / 2);
    }
  }
  return chain;
}

// A chain, and `beyond` times as much again along a smooth direction.
Eigen::MatrixXd Departures(Index runs, double beyond, std::uint64_t seed) {
  const Eigen::MatrixXd lower = Eigen::LLT<Eigen::MatrixXd>(Chain()).matrixL();
  Eigen::MatrixXd result(runs, kPathReadings);
  for (Index r = 0; r < runs; ++r) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kTest,
                         .iteration = 2,
                         .sample = static_cast<std::uint64_t>(r)});
    Eigen::VectorXd normal(kPathReadings);
    for (double& value : normal) value = stream.Normal();
    result.row(r) = lower * normal + std::sqrt(beyond) * stream.Normal() * Smooth();
  }
  return result;
}

std::vector<int> Groups(Index runs, int groups) {
  std::vector<int> group;
  for (Index r = 0; r < runs; ++r) group.push_back(static_cast<int>(r) % groups);
  return group;
}

TEST(ShrunkCovariance, ManyRunsOverruleTheClosedForm) {
  const Eigen::MatrixXd truth = Chain() + 40 * Smooth() * Smooth().transpose();
  const auto found = ShrinkCovariance(Departures(20000, 40, 1), Groups(20000, 500), Chain(),
                                      Eigen::MatrixXd::Identity(kPathReadings, kPathReadings));
  EXPECT_LT(found.target_weight, 0.02);
  EXPECT_LT((found.covariance - truth).norm() / truth.norm(), 0.03);
}

TEST(ShrunkCovariance, FewRunsKeepAClosedFormThatIsRight) {
  double weight = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    weight += ShrinkCovariance(Departures(40, 0, 100 + seed), Groups(40, 8), Chain(),
                               Chain() + Eigen::MatrixXd::Identity(kPathReadings, kPathReadings))
                  .target_weight /
              20;
  }
  EXPECT_GT(weight, 0.8);
}

// Five runs on each of eight packings: what scatters along a smooth direction is 14 and not 4.
TEST(ShrunkCovariance, FewRunsShowWhatTheClosedFormMisses) {
  const Eigen::VectorXd v = Smooth();
  const double closed = v.dot(Chain() * v);
  double along = 0;
  double weight = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto found =
        ShrinkCovariance(Departures(40, 10, 200 + seed), Groups(40, 8), Chain(),
                         Chain() + Eigen::MatrixXd::Identity(kPathReadings, kPathReadings));
    along += v.dot(found.covariance * v) / 20;
    weight += found.target_weight / 20;
  }
  EXPECT_GT(along, closed + 0.4 * 10);
  EXPECT_LT(along, closed + 1.1 * 10);
  EXPECT_LT(weight, 0.6);
}

// Copies of one run are one witness.
TEST(ShrunkCovariance, RunsOfAGroupAreOneWitness) {
  const Eigen::MatrixXd single = Departures(8, 10, 3);
  const Eigen::MatrixXd copies = single.replicate(5, 1);
  const Eigen::MatrixXd unit = Chain() + Eigen::MatrixXd::Identity(kPathReadings, kPathReadings);
  const auto from_single = ShrinkCovariance(single, Groups(8, 8), Chain(), unit);
  const auto from_copies = ShrinkCovariance(copies, Groups(40, 8), Chain(), unit);
  EXPECT_NEAR(from_copies.target_weight, from_single.target_weight, 1e-9);
  EXPECT_LT((from_copies.covariance - from_single.covariance).norm(), 1e-9);
}

TEST(ShrunkCovariance, OneGroupSaysNothing) {
  const auto found = ShrinkCovariance(Departures(40, 10, 4), Groups(40, 1), Chain(), Chain());
  EXPECT_EQ(found.target_weight, 1);
  EXPECT_EQ(found.covariance, Chain());
}

}  // namespace
}  // namespace calib::inference
