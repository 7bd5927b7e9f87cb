// Sobol indices of the Ishigami function, which are known in closed form, from the function itself
// and from an emulator of a few runs. An error found from 16 sets (8 parts) is itself uncertain:
// the limits are the quantiles of Student's t of 15 (7) degrees of freedom that a normal passes at
// four standard deviations, once in 16 000 times.

#include <gtest/gtest.h>

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numbers>

#include "inference/sampling/halton.h"
#include "inference/sampling/philox.h"
#include "inference/sensitivity/emulated_output.h"

namespace calib::inference {
namespace {

double Sigmas(int parts) {
  constexpr double kTail = 3.2e-5;
  return boost::math::quantile(
      boost::math::complement(boost::math::students_t_distribution<double>(parts - 1), kTail));
}
constexpr double kA = 7;
constexpr double kB = 0.1;

double Ishigami(const Eigen::VectorXd& x) {
  return std::sin(x[0]) + kA * std::pow(std::sin(x[1]), 2) +
         kB * std::pow(x[2], 4) * std::sin(x[0]);
}

// [Ishigami & Homma 1990]
struct Known {
  double variance = kA * kA / 8 + kB * std::pow(std::numbers::pi, 4) / 5 +
                    kB * kB * std::pow(std::numbers::pi, 8) / 18 + 0.5;
  double v1 = 0.5 * std::pow(1 + kB * std::pow(std::numbers::pi, 4) / 5, 2);
  double v2 = kA * kA / 8;
  double v13 = kB * kB * std::pow(std::numbers::pi, 8) * (1.0 / 18 - 1.0 / 50);
  Eigen::Vector3d First() const { return Eigen::Vector3d(v1, v2, 0) / variance; }
  Eigen::Vector3d Total() const { return Eigen::Vector3d(v1 + v13, v2, v13) / variance; }
};

std::vector<Prior> Cube() {
  return std::vector<Prior>(
      3, {.kind = PriorKind::kUniform, .min = -std::numbers::pi, .max = std::numbers::pi});
}

TEST(SobolIndices, OfTheIshigamiFunction) {
  const Known known;
  const auto sets = SobolSets(3, {.points = 1024});
  const auto indices = EstimateSobolIndices(sets, [](const Eigen::MatrixXd& unit) {
    Eigen::MatrixXd y(unit.rows(), 2);
    for (Eigen::Index i = 0; i < unit.rows(); ++i) {
      const Eigen::VectorXd x = (2 * unit.row(i).array() - 1) * std::numbers::pi;
      y(i, 0) = Ishigami(x);
      y(i, 1) = 5;  // moves with nothing
    }
    return y;
  });
  ASSERT_EQ(indices.size(), 2U);
  for (int j = 0; j < 3; ++j) {
    EXPECT_NEAR(indices[0].first[j], known.First()[j], Sigmas(16) * indices[0].first_error[j]);
    EXPECT_NEAR(indices[0].total[j], known.Total()[j], Sigmas(16) * indices[0].total_error[j]);
    EXPECT_LT(indices[0].first_error[j], 0.01);
    EXPECT_LT(indices[0].total_error[j], 0.01);
    EXPECT_TRUE(std::isnan(indices[1].total[j]));
  }
  EXPECT_NEAR(indices[0].variance, known.variance, 0.01 * known.variance);
}

TEST(SobolIndices, FromAnEmulatorOfAHundredRunsWithTheirError) {
  const Known known;
  const JointPrior priors = Cube();
  const Eigen::MatrixXd unit = Halton(120, 3);
  Eigen::MatrixXd parameters(120, 3);
  Eigen::MatrixXd outputs(120, 1);
  for (Eigen::Index i = 0; i < 120; ++i) {
    parameters.row(i) = priors.FromUnit(unit.row(i));
    outputs(i, 0) = Ishigami(parameters.row(i));
  }
  const auto result = AnalyseSensitivity(priors, parameters, outputs, parameters, {});
  ASSERT_TRUE(result.ok()) << result.status();
  const OutputSensitivity& y = result->front();
  EXPECT_GT(y.explained, 0.8);
  for (int j = 0; j < 3; ++j) {
    EXPECT_NEAR(y.indices.first[j], known.First()[j], Sigmas(8) * y.indices.first_error[j]);
    EXPECT_NEAR(y.indices.total[j], known.Total()[j], Sigmas(8) * y.indices.total_error[j]);
    EXPECT_LT(y.indices.total_error[j], 0.2);
  }
}

// The emulator learns from 120 runs at most. Every second one of Halton's points lies above the
// middle of the first parameter, where this function hardly moves.
TEST(SobolIndices, OfMoreRunsThanAreUsedWhateverTheirOrder) {
  constexpr int kRuns = 240;
  const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const Eigen::MatrixXd unit = Halton(kRuns, 2);
  Eigen::MatrixXd outputs(kRuns, 1);
  for (Eigen::Index i = 0; i < kRuns; ++i) {
    outputs(i, 0) = 3 * std::exp(-8 * unit(i, 0)) + 0.3 * unit(i, 1);
  }
  const auto result = AnalyseSensitivity(marginals, unit, outputs, unit, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_NEAR(result->front().indices.first[0], 0.98, 0.03);
  EXPECT_NEAR(result->front().indices.first[1], 0.02, 0.03);
}

// Points that stand there several times, as of a posterior of weights, count once.
TEST(SobolIndices, RepeatedPointsDoNotMakeCorrelationsMoreCertain) {
  const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const Eigen::MatrixXd unit = Halton(60, 2);
  Eigen::MatrixXd outputs(60, 1);
  for (Eigen::Index i = 0; i < 60; ++i) outputs(i, 0) = unit(i, 0) + std::pow(unit(i, 1), 2);
  const Eigen::MatrixXd repeated = unit.replicate(8, 1);
  const auto once = AnalyseSensitivity(marginals, unit, outputs, unit, {});
  const auto often = AnalyseSensitivity(marginals, unit, outputs, repeated, {});
  ASSERT_TRUE(once.ok() && often.ok());
  EXPECT_NEAR(often->front().correlation_error[0], once->front().correlation_error[0], 0.01);
}

// Runs near a posterior know nothing of the prior, however well a trend through them fits.
TEST(SobolIndices, AreNotGivenWhereNoRunIs) {
  const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  for (const double width : {1.0, 0.6, 0.1}) {
    const Eigen::MatrixXd runs = 0.5 + width * (Halton(40, 2).array() - 0.5);
    const Eigen::MatrixXd outputs = runs.col(0) + 0.2 * runs.col(1);
    const auto over_prior = AnalyseSensitivity(marginals, runs, outputs, Halton(200, 2), {});
    const auto near_runs = AnalyseSensitivity(marginals, runs, outputs, runs, {});
    ASSERT_TRUE(over_prior.ok() && near_runs.ok());
    const bool covers = width > 0.5;
    EXPECT_EQ(over_prior->front().out_of_reach, !covers) << width;
    EXPECT_EQ(over_prior->front().indices.total.size(), covers ? 2 : 0) << width;
    EXPECT_EQ(over_prior->front().correlation.size(), covers ? 2 : 0) << width;
    EXPECT_FALSE(near_runs->front().out_of_reach) << width;
    EXPECT_GT(near_runs->front().correlation[0], 0.9) << width;
  }
}

TEST(SobolIndices, RanksTellTheDirectionAndTiedPriorsHaveCorrelationsOnly) {
  const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const JointPrior priors =
      JointPrior::Create(marginals, {}, {{.coefficients = Eigen::Vector2d(1, 1), .limit = 1.5}})
          .value();
  const Eigen::MatrixXd unit = Halton(60, 2);
  Eigen::MatrixXd outputs(60, 1);
  for (Eigen::Index i = 0; i < 60; ++i) outputs(i, 0) = std::exp(3 * unit(i, 0)) - unit(i, 1);
  const auto result = AnalyseSensitivity(priors, unit, outputs, unit, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->front().indices.first.size(), 0);
  EXPECT_GT(result->front().correlation[0], 0.9);
  EXPECT_LT(result->front().correlation[1], 0);
}

// y = signal * x_0 + scatter of sd 1 at Halton's points.
Eigen::MatrixXd Scattering(const Eigen::MatrixXd& unit, double signal, std::uint64_t seed) {
  Eigen::MatrixXd y(unit.rows(), 1);
  PhiloxStream stream({.seed = seed});
  for (Eigen::Index i = 0; i < y.rows(); ++i) y(i, 0) = signal * unit(i, 0) + stream.Normal();
  return y;
}

const std::vector<Prior> kSquare(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});

TEST(SobolIndices, NothingIsSaidWhereTheEmulatorExplainsNothing) {
  const Eigen::MatrixXd unit = Halton(60, 2);
  int withheld = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Eigen::MatrixXd scatter = Scattering(unit, 0, seed);
    const auto result = AnalyseSensitivity(kSquare, unit, scatter, unit, {});
    ASSERT_TRUE(result.ok()) << result.status();
    const OutputSensitivity& y = result->front();
    EXPECT_LT(y.explained, 0.3);
    const double sd = std::sqrt((scatter.array() - scatter.mean()).square().mean());
    EXPECT_NEAR(y.sd, sd, 0.15 * sd) << "the runs differ all the same";
    if (y.Explains()) continue;
    ++withheld;
    EXPECT_EQ(y.indices.first.size(), 0);
    EXPECT_EQ(y.correlation.size(), 0);
  }
  EXPECT_GE(withheld, 4);

  const Eigen::MatrixXd equal = Eigen::MatrixXd::Constant(60, 1, 0.1);  // its mean is not, quite
  const auto result = AnalyseSensitivity(kSquare, unit, equal, unit, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(std::isnan(result->front().explained));
  EXPECT_FALSE(result->front().Explains());
  EXPECT_EQ(result->front().indices.first.size(), 0);
  EXPECT_NEAR(result->front().mean, 0.1, 1e-12);
  EXPECT_LT(result->front().sd, 1e-12);
}

// Of a weak signal some emulators of seven eighths of the runs are constant: that is uncertainty,
// not the end of the jackknife.
TEST(SobolIndices, AConstantPartOfTheJackknifeWidensErrorsAndLeavesThemFinite) {
  const Eigen::MatrixXd unit = Halton(30, 2);
  int told = 0;
  double widest = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto result = AnalyseSensitivity(kSquare, unit, Scattering(unit, 3, seed), unit, {});
    ASSERT_TRUE(result.ok()) << result.status();
    const OutputSensitivity& y = result->front();
    if (!y.Explains()) continue;
    ++told;
    EXPECT_TRUE(y.indices.first_error.allFinite()) << "seed " << seed;
    EXPECT_TRUE(y.indices.total_error.allFinite()) << "seed " << seed;
    EXPECT_TRUE(y.correlation_error.allFinite()) << "seed " << seed;
    widest = std::max(widest, y.indices.first_error[0]);
  }
  EXPECT_GE(told, 5);
  EXPECT_GT(widest, 0.3) << "none of the parts was constant";
}

// The sd of an output over a narrow posterior is not that of a well-known mean.
TEST(SobolIndices, TheSpreadOfAnOutputHoldsWhatTheEmulatorMisses) {
  const Eigen::MatrixXd unit = Halton(60, 2);
  Eigen::MatrixXd narrow = Halton(50, 2);
  narrow.array() = 0.5 + 1e-3 * narrow.array();
  const auto result = AnalyseSensitivity(kSquare, unit, Scattering(unit, 6, 1), narrow, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_GT(result->front().explained, 0.5);
  EXPECT_NEAR(result->front().sd, 1, 0.25);  // of the scatter, from 60 runs
}

TEST(SobolIndices, TooFewRunsAreRefused) {
  const Eigen::MatrixXd unit = Halton(10, 3);
  const auto result = AnalyseSensitivity(Cube(), unit, unit.leftCols(1), unit, {});
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace calib::inference
