// The parts of the emulator: minimiser, Gaussian process, principal components, likelihood.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "inference/emulator/emulated_likelihood.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/emulator/principal_components.h"
#include "inference/emulator/search_widening.h"
#include "inference/numerics/bounded_minimizer.h"
#include "inference/numerics/gaussian_process.h"
#include "inference/numerics/matern_kernel.h"
#include "inference/sampling/halton.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

PhiloxStream TestStream(std::uint64_t sample) {
  return PhiloxStream(
      {.seed = 11, .purpose = StreamPurpose::kTest, .iteration = 0, .sample = sample});
}

Eigen::MatrixXd Points(int n, int d) { return (Halton(n, d).array() - 0.5) * std::sqrt(12.0); }

double Rosenbrock(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) {
  const double valley = x[1] - x[0] * x[0];
  gradient.resize(2);
  gradient << -400 * x[0] * valley - 2 * (1 - x[0]), 200 * valley;
  return 100 * valley * valley + (1 - x[0]) * (1 - x[0]);
}

TEST(BoundedMinimizer, FindsAnInnerMinimum) {
  const Minimum minimum =
      MinimizeInBox(Rosenbrock, Eigen::Vector2d(-1.2, 1), Eigen::Vector2d(-2, -2),
                    Eigen::Vector2d(2, 2), {.max_iterations = 200, .tolerance = 1e-9});
  EXPECT_TRUE(minimum.converged);
  EXPECT_LT((minimum.x - Eigen::Vector2d(1, 1)).norm(), 1e-4);
}

TEST(BoundedMinimizer, FindsAMinimumOnTheBound) {
  const Minimum minimum =
      MinimizeInBox(Rosenbrock, Eigen::Vector2d(-1.2, 1), Eigen::Vector2d(-2, -2),
                    Eigen::Vector2d(0.5, 2), {.max_iterations = 200, .tolerance = 1e-9});
  EXPECT_EQ(minimum.x[0], 0.5);
  EXPECT_NEAR(minimum.x[1], 0.25, 1e-5);
}

TEST(MaternKernel, GradientOfTheObjectiveAgreesWithDifferences) {
  const Eigen::MatrixXd inputs = Points(25, 3);
  PhiloxStream stream = TestStream(0);
  Eigen::VectorXd outputs(25);
  for (Index i = 0; i < 25; ++i)
    outputs[i] = std::sin(inputs(i, 0)) + 0.3 * inputs(i, 1) + 0.1 * stream.Normal();
  const KernelObjective objective(inputs, outputs);
  Eigen::VectorXd x(5);
  x << 0.5, 1.0, 0.2, -0.4, -3.0;
  Eigen::VectorXd gradient(5);
  Eigen::VectorXd unused(5);
  objective(x, gradient);
  for (Index j = 0; j < 5; ++j) {
    const double h = 1e-5;
    Eigen::VectorXd above = x;
    Eigen::VectorXd below = x;
    above[j] += h;
    below[j] -= h;
    const double slope = (objective(above, unused) - objective(below, unused)) / (2 * h);
    EXPECT_NEAR(gradient[j], slope, 1e-6 * (1 + std::abs(slope))) << "hyper-parameter " << j;
  }
}

TEST(GaussianProcess, LeaveOneOutAgreesWithLeavingOut) {
  const Eigen::MatrixXd inputs = Points(30, 2);
  PhiloxStream stream = TestStream(1);
  Eigen::VectorXd outputs(30);
  for (Index i = 0; i < 30; ++i) outputs[i] = std::exp(0.5 * inputs(i, 0)) + 0.05 * stream.Normal();
  // The closed form in scaled units against a direct solution without row 7, the same covariance.
  Eigen::MatrixXd covariance =
      KernelMatrix(inputs, inputs, {.lengths = Eigen::RowVector2d(2, 3), .signal = 0.7});
  covariance.diagonal().array() += 0.01;
  const Eigen::MatrixXd inverse = covariance.inverse();
  const double error = (inverse * outputs)[7] / inverse(7, 7);
  std::vector<Index> others;
  for (Index i = 0; i < 30; ++i) {
    if (i != 7) others.push_back(i);
  }
  const Eigen::MatrixXd rest = covariance(others, others);
  const Eigen::VectorXd cross = covariance(others, 7);
  const Eigen::VectorXd solved = rest.llt().solve(Eigen::VectorXd(outputs(others)));
  EXPECT_NEAR(error, outputs[7] - cross.dot(solved), 1e-8);
  EXPECT_NEAR(1 / inverse(7, 7), covariance(7, 7) - cross.dot(rest.llt().solve(cross)), 1e-8);
}

TEST(GaussianProcess, LearnsASmoothFunctionAndItsScatter) {
  const Eigen::MatrixXd inputs = Points(80, 2);
  const auto function = [](double a, double b) { return 5 + 2 * a + std::sin(a) * b; };
  PhiloxStream stream = TestStream(2);
  Eigen::VectorXd outputs(80);
  for (Index i = 0; i < 80; ++i)
    outputs[i] = function(inputs(i, 0), inputs(i, 1)) + 0.1 * stream.Normal();
  const auto process = GaussianProcess::Fit(inputs, outputs);
  ASSERT_TRUE(process.ok());
  EXPECT_FALSE(process->constant());
  EXPECT_NEAR(std::sqrt(process->scatter_variance()), 0.1, 0.025);
  Eigen::MatrixXd points(2, 2);
  points << 0.3, -0.5, -1.0, 1.2;
  const GaussianProcessPrediction prediction = process->Predict(points);
  for (Index i = 0; i < 2; ++i) {
    EXPECT_NEAR(prediction.mean[i], function(points(i, 0), points(i, 1)),
                4 * std::sqrt(prediction.variance[i]));
    EXPECT_LT(prediction.variance[i], 0.1 * 0.1);
  }
  const LeaveOneOut& left_out = process->leave_one_out();
  const double calibration = (left_out.error.array().square() / left_out.variance.array()).mean();
  EXPECT_NEAR(calibration, 1, 0.35);  // sd of a mean of 80 chi-squares is 0.16
}

TEST(GaussianProcess, IsAConstantWhereInputsSayNothing) {
  const Eigen::MatrixXd inputs = Points(60, 3);
  PhiloxStream stream = TestStream(3);
  Eigen::VectorXd outputs(60);
  for (double& value : outputs) value = 4 + 0.5 * stream.Normal();
  const auto process = GaussianProcess::Fit(inputs, outputs);
  ASSERT_TRUE(process.ok());
  EXPECT_TRUE(process->constant());
  const GaussianProcessPrediction prediction = process->Predict(inputs.topRows(3));
  EXPECT_NEAR(prediction.mean[0], outputs.mean(), 1e-12);
  EXPECT_NEAR(process->leave_one_out().error[5], outputs[5] - (outputs.sum() - outputs[5]) / 59,
              1e-12);
}

// One of five inputs explains 40 % of the variance of 48 runs. With slopes along all inputs or none
// a fifth of such outputs is more than a constant.
TEST(GaussianProcess, KeepsOneWeakInputAmongFive) {
  constexpr int kSets = 60;
  int kept = 0;
  int invented = 0;
  double square = 0;
  for (int set = 0; set < kSets; ++set) {
    PhiloxStream stream = TestStream(1000 + static_cast<std::uint64_t>(set));
    Eigen::MatrixXd inputs(48, 5);
    for (double& value : inputs.reshaped()) value = (stream.Uniform() - 0.5) * std::sqrt(12.0);
    Eigen::VectorXd noise(48);
    for (double& value : noise) value = stream.Normal();
    const Eigen::VectorXd function = std::sqrt(0.4) * inputs.col(0);
    const auto weak = GaussianProcess::Fit(inputs, function + std::sqrt(0.6) * noise);
    ASSERT_TRUE(weak.ok());
    kept += weak->constant() ? 0 : 1;
    square += (weak->Predict(inputs).mean - function).squaredNorm() / (48 * kSets);
    EXPECT_EQ(weak->lengths().size(), 5);
    invented += GaussianProcess::Fit(inputs, noise)->constant() ? 0 : 1;
  }
  EXPECT_GE(kept, 0.85 * kSets);
  EXPECT_LE(invented, 0.05 * kSets);
  EXPECT_LT(square, 0.16);  // 0.4: nothing is known of the function
}

TEST(PrincipalComponents, KeepsAsManyAsTheNoiseAsksFor) {
  // Three directions of sd 10, 1 and 0.05 noise units per reading.
  Eigen::MatrixXd scores(60, 3);
  PhiloxStream stream = TestStream(4);
  for (Index i = 0; i < 60; ++i)
    scores.row(i) << 10 * stream.Normal(), stream.Normal(), 0.05 * stream.Normal();
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(3, 30);
  for (Index t = 0; t < 30; ++t) {
    directions.col(t) << 1, std::sqrt(2.0) * std::cos(0.1 * (t + 0.5) * std::numbers::pi),
        std::sqrt(2.0) * std::cos(0.3 * (t + 0.5) * std::numbers::pi);
  }
  const Eigen::MatrixXd rows = scores * directions;
  std::vector<Index> all;
  for (Index i = 0; i < 60; ++i) all.push_back(i);
  const auto components =
      FitPrincipalComponents(rows, Eigen::VectorXd::Ones(60), all, {.truncation = 0.01});
  EXPECT_EQ(components.basis.cols(), 2);
  EXPECT_LT(components.remainder.mean(), 0.01);
  EXPECT_GT(components.remainder.mean(), 0.001);
  const Eigen::MatrixXd identity = components.basis.transpose() * components.basis;
  EXPECT_LT((identity - Eigen::MatrixXd::Identity(2, 2)).norm(), 1e-10);
}

// Low-rank algebra against the covariance written out.
TEST(EmulatedLikelihood, AgreesWithTheDenseGaussian) {
  const int t = 12;
  const Eigen::MatrixXd inputs = Points(40, 2);
  Eigen::MatrixXd histories(40, t);
  PhiloxStream stream = TestStream(5);
  for (Index i = 0; i < 40; ++i) {
    for (Index k = 0; k < t; ++k) {
      histories(i, k) = 3 * inputs(i, 0) + 0.5 * k * inputs(i, 1) + std::sin(inputs(i, 0) * k) +
                        0.5 * stream.Normal();
    }
  }
  DataSet data;
  for (int k = 0; k < t; ++k) {
    data.readings.push_back(
        {.observable = k % 2, .load_step = k / 2, .control = 0.1 * k, .value = 1.0 + k, .sd = 0.2});
  }
  data.correlations.push_back({.experiment = 0, .observable = 1, .length = 0.3});
  std::vector<Index> all;
  for (Index i = 0; i < 40; ++i) all.push_back(i);
  const auto emulator = StateEmulator::Fit(inputs, histories, all, {.truncation = 0.05});
  ASSERT_TRUE(emulator.ok());
  const auto likelihood = EmulatedLikelihood::Create(data, *emulator, {.scatter_share = 0.5});
  ASSERT_TRUE(likelihood.ok());
  const ScorePrediction prediction = emulator->Predict(inputs.topRows(1));
  Eigen::MatrixXd factors(1, 2);
  factors << 1.7, 0.6;

  const PrincipalComponents& components = emulator->components();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(t, t);
  Eigen::MatrixXd as_stated = covariance;  // factors one
  for (int a = 0; a < t; ++a) {
    for (int b = 0; b < t; ++b) {
      if (a % 2 != b % 2) continue;
      const double noise = a == b ? 1 : a % 2 == 1 ? std::exp(-0.1 * std::abs(a - b) / 0.3) : 0;
      as_stated(a, b) = noise + (a == b ? components.remainder[a] : 0);
      covariance(a, b) = factors(0, a % 2) * as_stated(a, b);
    }
  }
  const Eigen::VectorXd spread = (prediction.sd.row(0).transpose().array().square() +
                                  0.5 * emulator->scatter_sd().array().square())
                                     .sqrt();
  const Eigen::MatrixXd scores =
      spread.asDiagonal() * emulator->correlation() * spread.asDiagonal();
  covariance += components.basis * scores * components.basis.transpose();
  covariance *= 0.2 * 0.2;
  as_stated += components.basis * scores * components.basis.transpose();
  as_stated *= 0.2 * 0.2;
  const Eigen::VectorXd residual =
      -0.2 * (components.mean.transpose() + components.basis * prediction.mean.row(0).transpose());
  const Eigen::LLT<Eigen::MatrixXd> dense(covariance);
  const double expected = -0.5 * t * std::log(2 * std::numbers::pi) -
                          0.5 * residual.dot(dense.solve(residual)) -
                          dense.matrixLLT().diagonal().array().log().sum();
  EXPECT_NEAR(likelihood->LogLikelihood(prediction, factors)[0], expected,
              1e-8 * std::abs(expected));

  // Of some readings alone: their own block of the covariance. The last are all of one group.
  for (const std::vector<Index>& some : {std::vector<Index>{2, 3, 5, 6, 11},
                                         std::vector<Index>{0, 1}, std::vector<Index>{1, 5, 9}}) {
    const Eigen::LLT<Eigen::MatrixXd> block(as_stated(some, some));
    const Eigen::VectorXd own = residual(some);
    const double misfit = own.dot(block.solve(own));
    EXPECT_NEAR(likelihood->Of(some).Misfit(prediction)[0], misfit, 1e-8 * misfit) << some.size();
  }
}

TEST(EmulatedPosterior, SaysWhatIsWrong) {
  const std::vector<Prior> priors(1, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  DataSet data;
  data.readings.push_back({.value = 1, .sd = 0.1});
  Iteration iteration;
  iteration.parameters = Halton(20, 1);
  iteration.predictions =
      Eigen::MatrixXd::Constant(20, 1, std::numeric_limits<double>::quiet_NaN());
  const auto code = [&](const EmulatorOptions& options) {
    return EmulatedPosterior(priors, data, options, {&iteration, 1}).status().code();
  };
  EXPECT_EQ(code({.noise = NoiseMode::kEssTarget}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.draws = 3}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.training = {.scatter_share = 2}}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({}), absl::StatusCode::kFailedPrecondition);  // all runs diverged
  iteration.predictions.resize(20, 2);
  EXPECT_EQ(code({}), absl::StatusCode::kInvalidArgument);  // two predictions for one reading
}

TEST(StateEmulator, RunsThatDifferInNothingAreNothingToEmulate) {
  const Eigen::MatrixXd inputs = Eigen::MatrixXd::Random(20, 2);
  std::vector<Index> all;
  for (Index i = 0; i < 20; ++i) all.push_back(i);
  for (const double value : {1.0, 1e200}) {
    const auto emulator =
        StateEmulator::Fit(inputs, Eigen::MatrixXd::Constant(20, 5, value), all, {});
    EXPECT_EQ(emulator.status().code(), absl::StatusCode::kFailedPrecondition) << value;
  }
}

// Of runs that miss two readings by 3 and 4 sd, by 30 and 40, and by NaN: half of the rms of the
// closest.
TEST(SearchWidening, IsHalfOfWhatTheClosestRunMissesTheReadingsBy) {
  DataSet data;
  data.readings = {{.value = 1, .sd = 0.1}, {.value = -2, .sd = 0.5}};
  Iteration iteration;
  iteration.predictions.resize(3, 2);
  iteration.predictions << 4, 18, 1.3, 0, std::numeric_limits<double>::quiet_NaN(), -2;
  EXPECT_NEAR(SearchWidening(data, {&iteration, 1}), 0.5 * std::sqrt((9. + 16) / 2), 1e-12);
  iteration.predictions.row(1) << 1.05, -2;
  EXPECT_EQ(SearchWidening(data, {&iteration, 1}), 1) << "not below the readings' own errors";
  EXPECT_EQ(SearchWidening(data, {}), 1);
}

TEST(ClosestDraws, AreTheTenthThatMissesLeast) {
  EmulatedResult emulated;
  emulated.draws.resize(25, 1);
  emulated.misfit.resize(25);
  for (Eigen::Index i = 0; i < 25; ++i) {
    emulated.draws(i, 0) = static_cast<double>(i);
    emulated.misfit[i] = std::abs(static_cast<double>(i) - 11.6);
  }
  EXPECT_EQ(ClosestDraws(emulated), Eigen::Vector2d(11, 12));
  emulated.draws.conservativeResize(4, 1);
  emulated.misfit.conservativeResize(4);
  EXPECT_EQ(ClosestDraws(emulated), Eigen::MatrixXd::Constant(1, 1, 3));
  EXPECT_EQ(ClosestDraws({}).rows(), 0);
}

}  // namespace
}  // namespace calib::inference
