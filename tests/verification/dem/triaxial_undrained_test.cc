// Undrained triaxial compression: constant volume, effective stresses, pore pressure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dem/registry/catalog.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

double Value(const State& state, const std::string& observable) {
  const auto& names = FindTest("triaxial_undrained")->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), observable) -
                                               names.begin())];
}

Scenario Undrained() {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.test = "triaxial_undrained";
  s.packing = test::SmallPacking(200);
  s.path = {{.target = 0, .load_step = 0},
            {.target = 0.004, .load_step = 1},
            {.target = 0.012, .load_step = 2},
            {.target = 0.008, .load_step = 3}};
  return s;
}

TEST(TriaxialUndrained, KeepsTheVolumeAndReportsThePorePressure) {
  const test::Run run = test::RunAll(Undrained());
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  ASSERT_EQ(run.states.size(), 4U);
  for (const State& state : run.states) {
    EXPECT_NEAR(Value(state, "volumetric_strain"), 0, 1e-15);
    EXPECT_NEAR(Value(state, "lateral_strain"), -0.5 * Value(state, "axial_strain"), 1e-15);
    EXPECT_NEAR(Value(state, "porosity"), Value(run.states[0], "porosity"), 1e-14);
    EXPECT_NEAR(Value(state, "pore_pressure") + Value(state, "lateral_stress"), 2e5, 1e-6);
  }
  EXPECT_NEAR(Value(run.states[0], "pore_pressure"), 0, 2e-3 * 2e5);
}

// Small strains are elastic: at constant volume the mean stress of an isotropic specimen stays, so
// the total-stress path of slope 3 gives the pore pressure u = q/3 [Skempton 1954, A = 1/3].
TEST(TriaxialUndrained, PorePressureBeginsWithSkemptonsThird) {
  Scenario s = Undrained();
  s.packing = test::SmallPacking(600);
  s.staging.unbalanced = 1e-4;
  s.path = {{.target = 0, .load_step = 0}, {.target = 1e-4, .load_step = 1}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  const double q =
      Value(run.states[1], "deviatoric_stress") - Value(run.states[0], "deviatoric_stress");
  const double u = Value(run.states[1], "pore_pressure") - Value(run.states[0], "pore_pressure");
  EXPECT_GT(q, 0);
  std::printf("u/q %.3f\n", u / q);
  EXPECT_NEAR(u / q, 1.0 / 3.0, 0.08);
}

}  // namespace
}  // namespace calib::dem
