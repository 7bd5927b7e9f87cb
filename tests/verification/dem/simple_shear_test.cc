// Simple shear in the tilting periodic cell: stresses against forces through a plane, contacts
// against brute force, boundary conditions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dem/dynamics/assembly.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "dem/registry/scenario_problems.h"
#include "dem/simulate/simulate.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using testing::HasSubstr;

double Value(const State& state, const std::string& observable) {
  const auto& names = FindTest("simple_shear")->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), observable) -
                                               names.begin())];
}

Scenario Shear(double constant_volume) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.test = "simple_shear";
  s.settings["constant_volume"] = constant_volume;
  s.packing = test::SmallPacking(200);
  s.path = {{.target = 0, .load_step = 0},
            {.target = 0.02, .load_step = 1},
            {.target = 0.01, .load_step = 2}};
  return s;
}

/// Shortest branch from grain i to j, searched over a generous set of images of the lattice.
std::array<double, 3> Branch(const Assembly& assembly, std::size_t i, std::size_t j) {
  const PeriodicCell& cell = assembly.cell();
  const ParticleArrays& p = assembly.particles();
  std::array<double, 3> best = {1e9, 1e9, 1e9};
  for (int sz = -2; sz <= 2; ++sz) {
    const double dz = p.z[j] - p.z[i] + sz * cell.length[2];
    double dx = p.x[j] - p.x[i] + sz * cell.displacement;
    dx -= std::round(dx / cell.length[0]) * cell.length[0];
    double dy = p.y[j] - p.y[i];
    dy -= std::round(dy / cell.length[1]) * cell.length[1];
    if (std::hypot(dx, dy, dz) < std::hypot(best[0], best[1], best[2])) {
      best = {dx, dy, dz};
    }
  }
  return best;
}

TEST(SimpleShear, HoldsTheNormalStressAndReachesExactStrains) {
  const test::Run run = test::RunAll(Shear(0));
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  const double strains[3] = {0, 0.02, 0.01};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(Value(run.states[k], "shear_strain"), strains[k], 1e-15);
    EXPECT_NEAR(Value(run.states[k], "axial_stress"), 2e5, 1e-3 * 2e5);
    EXPECT_NEAR(Value(run.states[k], "volumetric_strain"), Value(run.states[k], "axial_strain"),
                1e-15);
  }
  EXPECT_GT(Value(run.states[1], "shear_stress_ratio"), 0.2);
  EXPECT_LT(Value(run.states[1], "shear_stress_ratio"), 0.7);
  EXPECT_LT(Value(run.states[2], "shear_stress"), Value(run.states[1], "shear_stress") - 2e4);
}

TEST(SimpleShear, ConstantVolumeKeepsTheHeight) {
  const test::Run run = test::RunAll(Shear(1));
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  for (const State& state : run.states) {
    EXPECT_EQ(Value(state, "volumetric_strain"), 0);
  }
  EXPECT_GT(std::abs(Value(run.states[1], "axial_stress") - 2e5), 1e3);
}

TEST(SimpleShear, StartsAtTheStressAskedFor) {
  Scenario s = Shear(0);
  s.initial_stress = InitialStress{.axial = 3e5, .lateral = 2e5};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[1], "axial_stress"), 3e5, 3e2);
}

// Forces of the contacts that cross a horizontal plane, over its area, averaged over planes, are
// the normal and the shear stress; the specimen is at rest.
TEST(SimpleShear, StressesAreTheForcesThroughHorizontalPlanes) {
  Scenario s = Shear(0);
  s.staging.unbalanced = 1e-4;
  double normal = 0;
  double shear = 0;
  State last;
  const auto sink = [&](const State& state, const Assembly& assembly) {
    last = state;
    normal = shear = 0;
    const auto& list = assembly.neighbors();
    const PeriodicCell& cell = assembly.cell();
    for (int c = 0; c < list.size(); ++c) {
      if (assembly.touching(c)) {
        const auto d = Branch(assembly, static_cast<std::size_t>(list.first[c]),
                              static_cast<std::size_t>(list.second[c]));
        // The share of planes that a branch crosses is |dz|/Lz; force acts on its upper grain.
        const Vec3 f = assembly.force_on_j(c);
        const double share = d[2] / cell.length[2] / (cell.length[0] * cell.length[1]);
        normal += share * f.z;
        shear -= share * f.x;
      }
    }
    return absl::OkStatus();
  };
  const auto summary = SimulateGrains(s, sink, {});
  ASSERT_TRUE(summary.ok());
  ASSERT_EQ(summary->outcome, Outcome::kCompleted) << summary->reason;
  EXPECT_NEAR(normal, Value(last, "axial_stress"), 1e-9 * normal);
  // xz and zx differ by the moments that are not yet balanced.
  EXPECT_NEAR(shear, Value(last, "shear_stress"), 2e-3 * normal);
}

// Through more than a whole turn of the lattice: every overlapping pair is a contact, once.
TEST(SimpleShear, LargeStrainsMissNoContact) {
  Scenario s = Shear(0);
  s.packing = test::SmallPacking(60);
  s.staging.step = 0.05;
  s.staging.unbalanced = 1e-2;
  s.path.clear();
  for (int k = 0; k <= 8; ++k) {
    s.path.push_back({.target = 0.11 * k, .load_step = k});
  }
  int states = 0;
  double furthest = 0;
  const auto sink = [&](const State& /*state*/, const Assembly& assembly) {
    ++states;
    std::int64_t expected = 0;
    const ParticleArrays& p = assembly.particles();
    for (std::size_t i = 0; i < p.x.size(); ++i) {
      for (std::size_t j = i + 1; j < p.x.size(); ++j) {
        const auto d = Branch(assembly, i, j);
        expected += std::hypot(d[0], d[1], d[2]) < p.radius[i] + p.radius[j] ? 1 : 0;
      }
    }
    EXPECT_EQ(assembly.contacts(), expected);
    // Sixty grains that were hardly settled: the order of friction, no more.
    const double ratio = assembly.shear_stress() / assembly.stress()[2];
    EXPECT_LT(ratio, 0.8);
    if (states > 1) {
      EXPECT_GT(ratio, 0.05) << "state " << states;
    }
    furthest = assembly.cell().displacement / assembly.cell().length[0];
    return absl::OkStatus();
  };
  const auto summary = SimulateGrains(s, sink, {});
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->outcome, Outcome::kCompleted) << summary->reason;
  EXPECT_EQ(states, 9);
  EXPECT_GT(furthest, 0.5);
}

// Bonds along z of a cubic lattice slip by gamma d: zx is ks gamma/d, xz is zero while the grains
// have not turned, and shear_stress is their mean.
TEST(SimpleShear, StressOfASlightlyShearedLattice) {
  const double r = 1e-3;
  const double d = 1.99 * r;
  Packing packing;
  for (double& length : packing.length) {
    length = 5 * d;
  }
  for (int c = 0; c < 125; ++c) {
    packing.x.push_back((c % 5 + 0.3) * d);
    packing.y.push_back((c / 5 % 5 + 0.5) * d);
    packing.z.push_back((c / 25 + 0.9) * d);
    packing.radius.push_back(r);
    packing.clump.push_back(-1);
  }
  Assembly assembly(packing, 2650, ContactModelOf(test::LinearModel()), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  constexpr double kShear = 1e-6;
  assembly.Move({.shear = kShear / 1e-9, .dt = 1e-9});
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double ks = 0.6 * 2 * 1.2e8 * r / 2;
  const double expected = 0.5 * ks * kShear / d * (2 * r / d);  // slip counts on rigid arms
  // Turning bonds carry their normal force along: zx gains Fn gamma/d^2, both components.
  const double kn = 2 * 1.2e8 * r / 2;
  const double turned = -kn * (2 * r - d) * kShear / (d * d);
  EXPECT_NEAR(assembly.shear_stress(), expected + turned, 1e-6 * expected);
  EXPECT_NEAR(assembly.cell().displacement, kShear * 5 * d, 1e-15 * d);
}

TEST(SimpleShear, RefusesBadSettings) {
  Scenario s = Shear(0.5);
  s.path.push_back({.target = 1.5, .load_step = 9});
  const auto problems = ScenarioProblems(s);
  EXPECT_THAT(problems,
              testing::ElementsAre(HasSubstr("constant_volume is 0.5, allowed are whole numbers"),
                                   HasSubstr("shear_strain is 1.5, allowed is (-1, 1)")));
}

}  // namespace
}  // namespace calib::dem
