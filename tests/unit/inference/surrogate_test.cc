#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "inference/sampling/halton.h"
#include "inference/sampling/latin_hypercube.h"
#include "inference/surrogate/cubic_rbf.h"
#include "inference/surrogate/merit.h"
#include "inference/surrogate/response_surface.h"

namespace calib::inference {
namespace {

double Bowl(const Eigen::VectorXd& x) { return (x.array() - 0.3).square().sum(); }

TEST(CubicRbf, InterpolatesAndReproducesLinearFunctions) {
  const Eigen::MatrixXd points = Halton(30, 3);
  CubicRbf curved(3);
  CubicRbf linear(3);
  const Eigen::Vector3d slope(1, -2, 0.5);
  for (Eigen::Index i = 0; i < 30; ++i) {
    const Eigen::VectorXd x = points.row(i);
    ASSERT_TRUE(curved.Add(x, std::sin(5 * x[0]) + x[1] * x[2]).ok());
    ASSERT_TRUE(linear.Add(x, 2 + slope.dot(x)).ok());
  }
  for (Eigen::Index i = 0; i < 30; ++i) {
    const Eigen::VectorXd x = points.row(i);
    EXPECT_NEAR(curved.Value(x), std::sin(5 * x[0]) + x[1] * x[2], 1e-10);
  }
  const Eigen::Vector3d outside(1.3, -0.2, 0.4);
  EXPECT_NEAR(linear.Value(outside), 2 + slope.dot(outside), 1e-9);
  EXPECT_LT((linear.Gradient(outside) - slope).norm(), 1e-8);
  EXPECT_LT(std::abs(curved.coefficients().sum()), 1e-9);
}

// The first points lie on a line: they wait until the tail is determined.
TEST(CubicRbf, WaitsForPointsInGeneralPosition) {
  CubicRbf rbf(2);
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(rbf.Add(Eigen::Vector2d(0.2 * i, 0.2 * i), i * i).ok());
    EXPECT_FALSE(rbf.ready());
  }
  ASSERT_TRUE(rbf.Add(Eigen::Vector2d(0, 1), -1).ok());
  ASSERT_TRUE(rbf.ready());
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(rbf.Value(Eigen::Vector2d(0.2 * i, 0.2 * i)), i * i, 1e-10);
  EXPECT_NEAR(rbf.Value(Eigen::Vector2d(0, 1)), -1, 1e-10);
}

TEST(CubicRbf, RefusesCoincidingPointsAndStaysAsItWas) {
  CubicRbf rbf(1);
  for (const double x : {0.0, 0.4, 1.0})
    ASSERT_TRUE(rbf.Add(Eigen::VectorXd::Constant(1, x), x * x).ok());
  const double before = rbf.Value(Eigen::VectorXd::Constant(1, 0.7));
  EXPECT_EQ(rbf.Add(Eigen::VectorXd::Constant(1, 0.4), 3).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(rbf.Add(Eigen::VectorXd::Constant(1, 0.5), std::nan("")).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(rbf.size(), 3);
  EXPECT_EQ(rbf.Value(Eigen::VectorXd::Constant(1, 0.7)), before);
}

TEST(Merit, ExtremesOfTheWeight) {
  const Eigen::Vector3d values(3, 1, 2);
  const Eigen::Vector3d distances(0.1, 0.2, 0.5);
  EXPECT_EQ(BestCandidate(values, distances, {.weight = 1}), 1);
  EXPECT_EQ(BestCandidate(values, distances, {.weight = 0}), 2);
  EXPECT_EQ(BestCandidate(values, distances, {.weight = 1, .min_distance = 0.3}), 2);
  EXPECT_EQ(BestCandidate(values, distances, {.weight = 1, .min_distance = 9}),
            2);  // all too close: the farthest
  EXPECT_EQ(Merits(Eigen::Vector2d(4, 4), Eigen::Vector2d(1, 1), 0.3), Eigen::Vector2d(1, 1));
}

TEST(ResponseSurface, FirstDispatchesTheDesignThenWaits) {
  const ResponseSurfaceOptions options{.dimensions = 2, .workers = 3};
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok());
  CubicRbf surrogate(2);
  ASSERT_EQ(state->design.rows(), 8);  // 2 d + 1 + P
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
  EXPECT_FALSE(NextPoint(options, *state, surrogate).has_value());
  for (int i = 0; i < 5; ++i)
    ASSERT_TRUE(Report(options, i, Bowl(state->design.row(i)), *state).ok());
  EXPECT_TRUE(NextPoint(options, *state, surrogate).has_value());  // the other P still run
}

TEST(ResponseSurface, TheDesignIsAHypercubeBehindThePointsThatAreGiven) {
  const auto hypercube = [](int points) {
    return LatinHypercube(
        {.points = points, .dimensions = 2, .symmetric = true, .candidates = 1000, .seed = 3});
  };
  const auto plain = StartResponseSurface({.dimensions = 2, .initial_points = 10, .seed = 3});
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(plain->design, *hypercube(10));
  Eigen::MatrixXd given(4, 2);
  given << 0.7, 0.2, 0.71, 0.2, 0.7, 0.21, 1, 0;
  const auto joined = StartResponseSurface(
      {.dimensions = 2, .initial_points = 10, .first_points = given, .seed = 3});
  ASSERT_TRUE(joined.ok());
  ASSERT_EQ(joined->design.rows(), 10);
  EXPECT_EQ(joined->design.topRows(4), given);
  EXPECT_EQ(joined->design.bottomRows(6), *hypercube(6));
}

TEST(ResponseSurface, StepDoublesAfterSuccessesAndHalvesAfterFailures) {
  const ResponseSurfaceOptions options{.dimensions = 1, .max_evaluations = 40};
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok());
  CubicRbf surrogate(1);
  double value = 100;
  const auto evaluate = [&](double step) {
    ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
    value += step;
    const int id = static_cast<int>(state->evaluations.size()) - 1;
    ASSERT_TRUE(
        Report(options, id, step < 0 ? std::optional<double>(value) : std::nullopt, *state).ok());
  };
  for (int i = 0; i < 4; ++i) evaluate(-1);
  EXPECT_EQ(state->step, 0.2);
  for (int i = 0; i < 4; ++i) evaluate(1);  // terminated: no improvement
  EXPECT_EQ(state->step, 0.1);
  for (int i = 0; i < 4; ++i) evaluate(1);
  EXPECT_EQ(state->step, 0.05);
  value = -100;
  for (int i = 0; i < 3; ++i) evaluate(-1);
  EXPECT_EQ(state->step, 0.1);
  for (int i = 0; i < 24; ++i) evaluate(1);
  EXPECT_EQ(state->step, options.min_step);
}

TEST(ResponseSurface, KeepsAwayFromPendingAndTerminatedPoints) {
  const ResponseSurfaceOptions options{
      .dimensions = 2, .max_evaluations = 60, .workers = 4, .min_distance = 0.01};
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok());
  CubicRbf surrogate(2);
  int id = 0;
  for (; id < 9; ++id) {
    ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
    ASSERT_TRUE(Report(options, id, Bowl(state->evaluations.back().point), *state).ok());
  }
  for (; id < 30; ++id) {  // none of these ever finishes, every third is terminated
    ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
    if (id % 3 != 0) continue;
    ASSERT_TRUE(Report(options, id, std::nullopt, *state).ok());
  }
  EXPECT_EQ(surrogate.size(), 9);
  Eigen::MatrixXd points(30, 2);
  for (int i = 0; i < 30; ++i)
    points.row(i) = state->evaluations[static_cast<std::size_t>(i)].point;
  for (int i = 9; i < 30; ++i) {
    for (int k = 0; k < i; ++k) EXPECT_GE((points.row(i) - points.row(k)).norm(), 0.01);
  }
}

TEST(ResponseSurface, ResumesWithTheSameBits) {
  const ResponseSurfaceOptions options{.dimensions = 2, .seed = 5};
  auto kept = StartResponseSurface(options);
  ASSERT_TRUE(kept.ok());
  ResponseSurfaceState stored = *kept;
  CubicRbf surrogate(2);
  for (int id = 0; id < options.max_evaluations; ++id) {
    const auto point = NextPoint(options, *kept, surrogate);
    CubicRbf afresh(2);
    const auto resumed = NextPoint(options, stored, afresh);
    ASSERT_TRUE(point.has_value() && resumed.has_value());
    EXPECT_EQ(*point, *resumed);
    ASSERT_TRUE(Report(options, id, Bowl(*point), *kept).ok());
    ASSERT_TRUE(Report(options, id, Bowl(*point), stored).ok());
  }
  EXPECT_FALSE(NextPoint(options, *kept, surrogate).has_value());
}

TEST(ResponseSurface, TerminationFactorFallsWithTheBudget) {
  const ResponseSurfaceOptions options{
      .dimensions = 2, .max_evaluations = 46, .initial_points = 6, .termination = 8};
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(TerminationBound(options, 10, *state), std::numeric_limits<double>::infinity());
  CubicRbf surrogate(2);
  ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
  ASSERT_TRUE(Report(options, 0, 2.0, *state).ok());
  EXPECT_EQ(TerminationBound(options, 3, *state), std::numeric_limits<double>::infinity());
  EXPECT_EQ(TerminationBound(options, 6, *state), 16);
  EXPECT_EQ(TerminationBound(options, 26, *state), 8);
  EXPECT_EQ(TerminationBound(options, 36, *state), 4);
}

TEST(ResponseSurface, SaysWhatIsWrong) {
  EXPECT_FALSE(StartResponseSurface({.dimensions = 0}).ok());
  EXPECT_FALSE(StartResponseSurface({.dimensions = 3, .max_evaluations = 5}).ok());
  EXPECT_FALSE(StartResponseSurface({.dimensions = 2, .weights = {}}).ok());
  EXPECT_FALSE(StartResponseSurface({.dimensions = 2, .min_step = 0.5}).ok());
  const auto behind = [](const Eigen::MatrixXd& given) {
    return StartResponseSurface({.dimensions = 2, .initial_points = 6, .first_points = given});
  };
  EXPECT_TRUE(behind(Halton(4, 2)).ok());
  EXPECT_FALSE(behind(Halton(5, 2)).ok()) << "one point is no hypercube";
  EXPECT_FALSE(behind(Halton(4, 3)).ok());
  EXPECT_FALSE(behind(2 * Halton(4, 2)).ok());
  const ResponseSurfaceOptions options{.dimensions = 2};
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(Report(options, 0, 1.0, *state).code(), absl::StatusCode::kInvalidArgument);
  CubicRbf surrogate(2);
  ASSERT_TRUE(NextPoint(options, *state, surrogate).has_value());
  EXPECT_EQ(Report(options, 0, std::nan(""), *state).code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(Report(options, 0, 1.0, *state).ok());
  EXPECT_EQ(Report(options, 0, 1.0, *state).code(),
            absl::StatusCode::kInvalidArgument);  // no longer pending
}

}  // namespace
}  // namespace calib::inference
