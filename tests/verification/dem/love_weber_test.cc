// Stress of lattices whose contact forces are known.
#include <gtest/gtest.h>

#include <cmath>

#include "dem/dynamics/assembly.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

/// Simple cubic lattice of n^3 equal spheres with three spacings.
Packing Lattice(int n, double radius, const double spacing[3]) {
  Packing p;
  for (int a = 0; a < 3; ++a) {
    p.length[a] = n * spacing[a];
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        p.x.push_back((i + 0.3) * spacing[0]);
        p.y.push_back((j + 0.5) * spacing[1]);
        p.z.push_back((k + 0.9) * spacing[2]);
        p.radius.push_back(radius);
        p.clump.push_back(-1);
      }
    }
  }
  return p;
}

TEST(LoveWeber, CubicLatticeCarriesForceOverCellArea) {
  const double r = 1e-3;
  const double spacing[3] = {1.99 * r, 1.98 * r,
                             2.01 * r};  // touching along x and y, apart along z
  Assembly assembly(Lattice(5, r, spacing), 2650, ContactModelOf(test::LinearModel()), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double kn = 2 * 1.2e8 * r / 2;
  const double expected_x = kn * 0.01 * r / (spacing[1] * spacing[2]);
  const double expected_y = kn * 0.02 * r / (spacing[0] * spacing[2]);
  EXPECT_NEAR(assembly.stress()[0], expected_x, 1e-10 * expected_x);
  EXPECT_NEAR(assembly.stress()[1], expected_y, 1e-10 * expected_y);
  EXPECT_EQ(assembly.stress()[2], 0);
  EXPECT_EQ(assembly.contacts(), 2 * 125);
  EXPECT_NEAR(assembly.UnbalancedForce(), 0, 1e-9);
}

TEST(LoveWeber, AffineStiffnessOfTheLatticePredictsItsStress) {
  // A cubic lattice deforms affinely: compressing z by 1e-5 raises the stress by modulus * 1e-5.
  const double r = 1e-3;
  const double spacing[3] = {1.99 * r, 1.99 * r, 1.99 * r};
  Assembly assembly(Lattice(5, r, spacing), 2650, ContactModelOf(test::LinearModel()), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  StiffnessEstimate estimate;
  ASSERT_TRUE(assembly.EstimateStiffness(estimate).ok());
  const double before = assembly.stress()[2];
  constexpr double kStrain = 1e-5;
  assembly.Move({.stretch = {0, 0, -kStrain / 1e-9}, .dt = 1e-9, .damping = 0});
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double expected = estimate.modulus[2] * kStrain;
  EXPECT_NEAR(assembly.stress()[2] - before, expected, 2e-2 * expected);
}

TEST(TimeStep, CriticalStepOfALatticeIsThatOfItsSprings) {
  const double r = 1e-3;
  const double spacing[3] = {1.99 * r, 1.99 * r, 1.99 * r};
  Model model = test::LinearModel();
  model.parameters["poisson_ratio"] = 0;  // central forces only
  Assembly assembly(Lattice(5, r, spacing), 2650, ContactModelOf(model), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  StiffnessEstimate estimate;
  ASSERT_TRUE(assembly.EstimateStiffness(estimate).ok());
  const double kn = 2 * 1.2e8 * r / 2;
  const double mass = 2650 * 4.0 / 3.0 * std::acos(-1.0) * r * r * r;
  EXPECT_NEAR(estimate.critical_step, std::sqrt(mass / (2 * kn)), 1e-9 * estimate.critical_step);
}

}  // namespace
}  // namespace calib::dem
