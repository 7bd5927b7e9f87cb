// The optimiser on functions whose minimum is known, with budgets of an expensive model.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <iostream>
#include <numbers>
#include <optional>
#include <vector>

#include "inference/surrogate/expected_improvement.h"
#include "inference/surrogate/response_surface.h"

namespace calib::inference {
namespace {

using Function = std::function<double(const Eigen::VectorXd&)>;

double Branin(const Eigen::VectorXd& u) {
  constexpr double kPi = std::numbers::pi;
  const double x = 15 * u[0] - 5;
  const double y = 15 * u[1];
  const double valley = y - 5.1 / (4 * kPi * kPi) * x * x + 5 / kPi * x - 6;
  return valley * valley + 10 * (1 - 1 / (8 * kPi)) * std::cos(x) + 10;
}

double Rosenbrock(const Eigen::VectorXd& u) {
  const Eigen::VectorXd x = 4 * u.array() - 2;
  double sum = 0;
  for (Eigen::Index j = 0; j + 1 < x.size(); ++j) {
    sum += 100 * std::pow(x[j + 1] - x[j] * x[j], 2) + std::pow(1 - x[j], 2);
  }
  return sum;
}

double Ackley(const Eigen::VectorXd& u) {
  const Eigen::ArrayXd x = 30 * (u.array() - 0.6);
  return -20 * std::exp(-0.2 * std::sqrt(x.square().mean())) -
         std::exp((2 * std::numbers::pi * x).cos().mean()) + 20 + std::numbers::e;
}

enum class Chooser { kMerit, kExpectedImprovement };

// P workers that finish in the order they began; every value goes back at once.
double Minimise(const Function& function, const ResponseSurfaceOptions& options,
                Chooser chooser = Chooser::kMerit) {
  auto state = StartResponseSurface(options);
  EXPECT_TRUE(state.ok());
  CubicRbf surrogate(options.dimensions);
  std::deque<int> running;
  while (true) {
    while (static_cast<int>(running.size()) < options.workers) {
      const auto next = chooser == Chooser::kMerit
                            ? NextPoint(options, *state, surrogate)
                            : NextByExpectedImprovement(options, *state).value();
      if (!next.has_value()) break;
      running.push_back(static_cast<int>(state->evaluations.size()) - 1);
    }
    if (running.empty()) break;
    const int id = running.front();
    running.pop_front();
    const double value = function(state->evaluations[static_cast<std::size_t>(id)].point);
    EXPECT_TRUE(Report(options, id, value, *state).ok());
  }
  EXPECT_EQ(static_cast<int>(state->evaluations.size()), options.max_evaluations);
  return state->evaluations[static_cast<std::size_t>(state->best)].value;
}

double Median(const Function& function, ResponseSurfaceOptions options) {
  std::vector<double> values;
  for (options.seed = 1; options.seed <= 9; ++options.seed)
    values.push_back(Minimise(function, options));
  std::sort(values.begin(), values.end());
  return values[4];
}

TEST(SurrogateOptimum, Branin) {
  const double serial = Median(Branin, {.dimensions = 2, .max_evaluations = 60});
  const double parallel = Median(Branin, {.dimensions = 2, .max_evaluations = 60, .workers = 4});
  std::cout << "Branin, 60 evaluations: " << serial << ", with 4 workers " << parallel
            << " (minimum 0.397887)\n";
  EXPECT_LT(serial, 0.397887 + 0.02);  // of a range of 300
  EXPECT_LT(parallel, 0.397887 + 0.02);
}

TEST(SurrogateOptimum, Rosenbrock) {
  const double serial = Median(Rosenbrock, {.dimensions = 2, .max_evaluations = 100});
  const double parallel =
      Median(Rosenbrock, {.dimensions = 2, .max_evaluations = 100, .workers = 4});
  std::cout << "Rosenbrock, 100 evaluations: " << serial << ", with 4 workers " << parallel
            << " (minimum 0)\n";
  EXPECT_LT(serial, 0.5);  // of a range of 3600
  EXPECT_LT(parallel, 0.5);
}

TEST(SurrogateOptimum, Ackley) {
  const double serial = Median(Ackley, {.dimensions = 3, .max_evaluations = 120});
  const double parallel = Median(Ackley, {.dimensions = 3, .max_evaluations = 120, .workers = 4});
  std::cout << "Ackley, 120 evaluations: " << serial << ", with 4 workers " << parallel
            << " (minimum 0)\n";
  EXPECT_LT(serial, 3);  // of a range of 22
  EXPECT_LT(parallel, 3);
}

// The number of evaluations after which the best is within 1 % of the minimum, 0: never.
int EvaluationsToOnePercent(const ResponseSurfaceOptions& options) {
  auto state = StartResponseSurface(options);
  EXPECT_TRUE(state.ok());
  for (int k = 0; k < options.max_evaluations; ++k) {
    const auto next = NextByExpectedImprovement(options, *state);
    EXPECT_TRUE(next.ok() && next->has_value());
    const double value = Branin(**next);
    EXPECT_TRUE(Report(options, k, value, *state).ok());
    if (value <= 1.01 * 0.397887) return k + 1;
  }
  return 0;
}

// The initial design is of seven points unless told otherwise. Medians of five seeds when the
// limits were set: 24, and 30 with 21 initial points.
TEST(ExpectedImprovementOptimum, BraninWithinOnePercent) {
  for (const int initial : {0, 21}) {
    std::vector<int> counts;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      counts.push_back(EvaluationsToOnePercent(
          {.dimensions = 2, .max_evaluations = 45, .initial_points = initial, .seed = seed}));
      EXPECT_GT(counts.back(), 0) << "seed " << seed << ", " << initial << " initial points";
    }
    std::sort(counts.begin(), counts.end());
    std::cout << "Branin by expected improvement, within 1 % after " << counts[0] << " to "
              << counts[4] << " evaluations, median " << counts[2] << " (" << initial
              << " initial points, 0: the default)\n";
    EXPECT_LE(counts[2], initial == 0 ? 28 : 35);
  }
}

// Four at once: what is pending counts with its prediction.
TEST(ExpectedImprovementOptimum, BraninWithFourWorkers) {
  std::vector<double> values;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    values.push_back(Minimise(Branin,
                              {.dimensions = 2, .max_evaluations = 40, .workers = 4, .seed = seed},
                              Chooser::kExpectedImprovement));
  }
  std::sort(values.begin(), values.end());
  std::cout << "Branin, 40 evaluations by expected improvement with 4 workers: " << values[1]
            << " (minimum 0.397887)\n";
  EXPECT_LT(values[1], 0.397887 + 0.02);
}

// Spheres that hit a plate at 20 to 70 degrees: normal restitution exp(-pi z) of damping ratio z
// from 1e-3 to 1 (log), tangential restitution max(0.6, 1 - mu (1 + e) / tan(angle)) of friction mu
// from 0.05 to 0.6 [Thornton et al. 2013]; truth z = 0.04, mu = 0.15. Squared residuals over those
// of 0.02, reading by reading; ended when their sum exceeds `bound` readings times: then nullopt,
// and what was reached.
struct Misfit {
  std::optional<double> value;
  double reached = 0;  // chi-squared per reading
};
Misfit Collisions(const Eigen::VectorXd& u, double bound) {
  constexpr int kAngles = 6;
  const auto restitution = [](double z, double mu, double angle) {
    const double e = std::exp(-std::numbers::pi * z);
    return Eigen::Vector2d(e, std::max(0.6, 1 - mu * (1 + e) / std::tan(angle)));
  };
  double sum = 0;
  for (int i = 0; i < kAngles; ++i) {
    const double angle = (20 + 10 * i) * std::numbers::pi / 180;
    const Eigen::Vector2d error =
        restitution(std::pow(10, -3 + 3 * u[0]), 0.05 + 0.55 * u[1], angle) -
        restitution(0.04, 0.15, angle);
    sum += (error / 0.02).squaredNorm() + 2 * 0.5;  // a misfit that no parameter takes away
    if (sum > 2 * kAngles * bound) return {std::nullopt, sum / (2 * kAngles)};
  }
  return {sum / (2 * kAngles), sum / (2 * kAngles)};
}

// A place where runs were stopped does not go on promising what they have refuted: before, all that
// came after the design lay there for some seeds.
TEST(ExpectedImprovementOptimum, LeavesAPlaceWhereItsRunsWereStoppedEarly) {
  for (std::uint64_t seed = 1; seed <= 9; ++seed) {
    const ResponseSurfaceOptions options{
        .dimensions = 2, .max_evaluations = 50, .initial_points = 12, .seed = seed};
    auto state = StartResponseSurface(options);
    ASSERT_TRUE(state.ok());
    for (int k = 0; k < options.max_evaluations; ++k) {
      const auto next = NextByExpectedImprovement(options, *state);
      ASSERT_TRUE(next.ok() && next->has_value());
      const Misfit misfit = Collisions(**next, TerminationBound(options, k, *state));
      ASSERT_TRUE(Report(options, k, misfit.value, *state,
                         misfit.value ? std::nullopt : std::optional<double>(misfit.reached))
                      .ok());
    }
    const double best = state->evaluations[static_cast<std::size_t>(state->best)].value;
    std::cout << "Collisions, 50 runs ended early, seed " << seed << ": best " << best
              << " (minimum 0.5), " << state->completed.size() << " finished\n";
    EXPECT_LT(best, 0.52) << "seed " << seed;
  }
}

TEST(ExpectedImprovementOptimum, StaysWherePointsAreAdmissible) {
  ResponseSurfaceOptions options{.dimensions = 2, .max_evaluations = 24};
  options.admissible = [](const Eigen::VectorXd& u) { return u[0] + u[1] <= 0.6; };
  for (const Chooser chooser : {Chooser::kMerit, Chooser::kExpectedImprovement}) {
    auto state = StartResponseSurface(options);
    ASSERT_TRUE(state.ok());
    CubicRbf surrogate(2);
    for (int k = 0; k < options.max_evaluations; ++k) {
      const auto next = chooser == Chooser::kMerit
                            ? NextPoint(options, *state, surrogate)
                            : NextByExpectedImprovement(options, *state).value();
      ASSERT_TRUE(next.has_value());
      EXPECT_LE(next->sum(), 0.6);
      ASSERT_TRUE(Report(options, k, Branin(*next), *state).ok());
    }
  }
}

// A slab that no draw over the cube and hardly one about the best point meets.
TEST(ExpectedImprovementOptimum, FindsAPointWhereHardlyAnyIsAdmissible) {
  ResponseSurfaceOptions options{.dimensions = 2, .max_evaluations = 10};
  options.admissible = [](const Eigen::VectorXd& u) { return std::abs(u[0] - 0.3) < 1e-5; };
  auto state = StartResponseSurface(options);
  ASSERT_TRUE(state.ok()) << state.status();
  for (int k = 0; k < options.max_evaluations; ++k) {
    const auto next = NextByExpectedImprovement(options, *state);
    ASSERT_TRUE(next.ok() && next->has_value()) << next.status();
    ASSERT_EQ((*next)->size(), 2);
    EXPECT_NEAR((**next)[0], 0.3, 1e-5);
    ASSERT_TRUE(Report(options, k, Branin(**next), *state).ok());
  }
}

// E[max(best - f, 0)] by quadrature.
TEST(ExpectedImprovementOptimum, ClosedFormIsTheIntegral) {
  for (const double mean : {-1.0, 0.3, 2.5}) {
    constexpr double kSd = 0.7;
    double sum = 0;
    constexpr int kCells = 200000;
    for (int i = 0; i < kCells; ++i) {
      const double z = -12 + 24 * (i + 0.5) / kCells;
      sum += std::max(0.5 - mean - kSd * z, 0.0) * std::exp(-0.5 * z * z) * 24 / kCells;
    }
    EXPECT_NEAR(ExpectedImprovement(0.5, mean, kSd), sum / std::sqrt(2 * std::numbers::pi), 1e-8);
  }
  EXPECT_EQ(ExpectedImprovement(0.5, 0.2, 0), 0.3);
}

}  // namespace
}  // namespace calib::inference
