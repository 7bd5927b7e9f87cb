// What the lab tests promise: exact strains, held stresses, prepared states, reported failures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dem/registry/catalog.h"
#include "dem/simulate/simulate.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using testing::HasSubstr;

double Value(const State& state, const std::string& observable) {
  const auto& names = FindTest("triaxial_drained")->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), observable) -
                                               names.begin())];
}

TEST(TriaxialDrained, StopsAtExactlyTheAskedStrains) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.path = {{.target = 0, .load_step = 3},
            {.target = 0.00123456789, .load_step = 4},
            {.target = 0.0101, .load_step = -1},
            {.target = 0.005, .load_step = 9}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  ASSERT_EQ(run.states.size(), 3U);
  EXPECT_EQ(run.states[2].load_step, 9);
  EXPECT_NEAR(Value(run.states[0], "axial_strain"), 0, 1e-15);
  EXPECT_NEAR(Value(run.states[1], "axial_strain"), 0.00123456789, 1e-15);
  EXPECT_NEAR(Value(run.states[2], "axial_strain"), 0.005, 1e-15);
}

TEST(TriaxialDrained, HoldsTheLateralStressAndRelationsBetweenObservables) {
  const test::Run run = test::RunAll(test::SmallTriaxial(test::HertzModel()));
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  for (const State& state : run.states) {
    EXPECT_NEAR(Value(state, "lateral_stress"), 2e5, 1e-3 * 2e5);
    const double p = (Value(state, "axial_stress") + 2 * Value(state, "lateral_stress")) / 3;
    EXPECT_NEAR(Value(state, "mean_stress"), p, 1e-9 * p);
    EXPECT_NEAR(Value(state, "volumetric_strain"),
                Value(state, "axial_strain") + 2 * Value(state, "lateral_strain"), 1e-14);
    const double n = Value(state, "porosity");
    EXPECT_NEAR(Value(state, "void_ratio"), n / (1 - n), 1e-12);
  }
  EXPECT_GT(Value(run.states[2], "stress_ratio"), 1.3);
  EXPECT_TRUE(run.summary.staging.rate.has_value());
  EXPECT_EQ(*run.summary.staging.step, 0.002);
  EXPECT_EQ(*run.summary.staging.damping_settling, 0.9);
}

TEST(Oedometric, HasNoLateralStrainAndDissipatesInACycle) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.test = "oedometric";
  s.path = {{.target = 0.01, .load_step = 0},
            {.target = 0.006, .load_step = 1},
            {.target = 0.01, .load_step = 2}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  for (const State& state : run.states) {
    EXPECT_EQ(Value(state, "lateral_strain"), 0);
  }
  EXPECT_LT(Value(run.states[1], "axial_stress"), Value(run.states[0], "axial_stress"));
  EXPECT_NEAR(Value(run.states[2], "axial_stress"), Value(run.states[0], "axial_stress"),
              0.15 * Value(run.states[0], "axial_stress"));
}

// A laboratory puts weights on: at the stresses of a strain-driven run the strains are that run's,
// and no axis but the loaded one moves.
TEST(Oedometric, DrivenByStressReachesTheStrainsOfTheStrainDrivenTest) {
  Scenario by_strain = test::SmallTriaxial(test::HertzModel());
  by_strain.test = "oedometric";
  by_strain.packing = test::SmallPacking(200);
  by_strain.path = {{.target = 0.006, .load_step = 0},
                    {.target = 0.012, .load_step = 1},
                    {.target = 0.009, .load_step = 2}};
  const test::Run strained = test::RunAll(by_strain);
  Scenario by_stress = by_strain;
  by_stress.settings[kStressDriven] = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    by_stress.path[k].target = Value(strained.states[k], "axial_stress");
  }
  const test::Run stressed = test::RunAll(by_stress);
  ASSERT_EQ(stressed.summary.outcome, Outcome::kCompleted) << stressed.summary.reason;
  for (std::size_t k = 0; k < 3; ++k) {
    const State& state = stressed.states[k];
    EXPECT_NEAR(Value(state, "axial_stress") / by_stress.path[k].target, 1, 2e-3) << k;
    EXPECT_EQ(Value(state, "lateral_strain"), 0) << k;
    EXPECT_NEAR(Value(state, "axial_strain"), by_strain.path[k].target, 6e-4) << k;
  }
  EXPECT_LT(Value(stressed.states[2], "axial_strain"), Value(stressed.states[1], "axial_strain"));
}

TEST(Oedometric, DrivenByStressThroughALoadCellReadsTheStressAskedFor) {
  Scenario s = test::With(test::SmallTriaxial(test::HertzModel()), "load_cell_error",
                          {{"gain", 0.05}, {"offset", 4e3}});
  s.test = "oedometric";
  s.settings[kStressDriven] = 1;
  s.path = {{.target = 6e5, .load_step = 0}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[0], "axial_stress") / 6e5, 1, 2e-3);
}

TEST(Isotropic, ReachesEachMeanStressWithEqualAxes) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.test = "isotropic";
  s.path = {{.target = 2e5, .load_step = 0},
            {.target = 8e5, .load_step = 1},
            {.target = 3e5, .load_step = 2}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  const double expected[3] = {2e5, 8e5, 3e5};
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(Value(run.states[k], "mean_stress"), expected[k], 1e-3 * expected[k]);
    EXPECT_NEAR(Value(run.states[k], "stress_ratio"), 1, 2e-3);
  }
  EXPECT_GT(Value(run.states[1], "volumetric_strain"), Value(run.states[2], "volumetric_strain"));
}

TEST(Consolidation, FrictionIsLoweredUntilThePorosityHolds) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = test::SmallPacking(200);
  s.path = {{.target = 0, .load_step = 0}};
  const double loose = Value(test::RunAll(s).states[0], "porosity");
  s.consolidation.porosity = loose - 0.01;
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[0], "porosity"), loose - 0.01, 3e-4);
  EXPECT_NEAR(Value(run.states[0], "mean_stress"), 2e5, 2e2);

  s.consolidation.porosity = 0.55;
  const auto refused = Simulate(s, [](const State&) {}, {});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kOutOfRange);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("attainable"));
}

TEST(Consolidation, AnotherFrictionGivesAnotherDensityAndIsRestored) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  const test::Run own = test::RunAll(s);
  s.consolidation.friction_coefficient = 0.02;
  const test::Run lubricated = test::RunAll(s);
  EXPECT_LT(Value(lubricated.states[0], "porosity"), Value(own.states[0], "porosity") - 1e-3);
  EXPECT_GT(Value(lubricated.states[2], "stress_ratio"), 1.3) << "friction was not restored";
}

TEST(Consolidation, InitialStressReplacesTheIsotropicStart) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.initial_stress = InitialStress{.axial = 3e5, .lateral = 2e5};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[0], "axial_stress"), 3e5, 3e2);
  EXPECT_NEAR(Value(run.states[2], "lateral_stress"), 2e5, 2e2);
}

// With both, the porosity is that at which loading begins.
TEST(Consolidation, ThePorosityHoldsAtTheInitialStress) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = test::SmallPacking(200);
  s.path = {{.target = 0, .load_step = 0}};
  s.initial_stress = InitialStress{.axial = 4e5, .lateral = 2e5};
  const double loose = Value(test::RunAll(s).states[0], "porosity");
  s.consolidation.porosity = loose - 0.01;
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[0], "porosity"), loose - 0.01, 1.01e-4);
  EXPECT_NEAR(Value(run.states[0], "axial_stress"), 4e5, 4e2);

  s.consolidation.porosity = loose + 0.02;
  const auto refused = Simulate(s, [](const State&) {}, {});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kOutOfRange);
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("cannot be met at the initial stress (axial 400000 Pa, lateral 200000 "
                        "Pa): porosity "));
}

// 4 x 4 x 4 grains that just touch, without the first one.
Packing TouchingLattice() {
  constexpr int kSide = 4;
  constexpr double kRadius = 1e-3;
  Packing packing;
  for (double& length : packing.length) {
    length = 2 * kRadius * kSide;
  }
  for (int i = 1; i < kSide * kSide * kSide; ++i) {
    packing.x.push_back(kRadius * (2 * (i % kSide) + 1));
    packing.y.push_back(kRadius * (2 * (i / kSide % kSide) + 1));
    packing.z.push_back(kRadius * (2 * (i / kSide / kSide) + 1));
    packing.radius.push_back(kRadius);
    packing.clump.push_back(-1);
  }
  return packing;
}

// Its first time step would be judged at almost no overlap.
TEST(Consolidation, ALatticeThatJustTouchesIsCompressed) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = TouchingLattice();
  s.model.density = 2650;
  s.model.parameters["young_modulus"] = 1e9;
  s.model.parameters["friction_coefficient"] = 2;
  s.settings["confining_pressure"] = 1e5;
  s.path = {{.target = 0, .load_step = 0}};
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(Value(run.states[0], "mean_stress"), 1e5, 1e2);
}

TEST(Failure, ASpecimenThatYieldsWithoutEndIsSaidToCollapse) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.model.effects = {"initial_fabric"};
  s.model.parameters["initial_fabric.stress_anisotropy"] = 1.5;  // axial four times lateral
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason,
              testing::ContainsRegex("consolidation: the specimen collapses under axial [0-9e+.]+ "
                                     "Pa, lateral [0-9e+.]+ Pa: strain 0.[0-9]+ along z in this "
                                     "stage; the cell has become too short along z"));
}

TEST(Failure, AMomentStiffnessThatLeavesNoTimeStepIsNamed) {
  for (const std::string effect : {"rolling_resistance", "twisting_resistance"}) {
    const test::Run run = test::RunAll(test::With(test::SmallTriaxial(test::HertzModel()), effect,
                                                  {{"stiffness", 1e8}, {"friction", 0.5}}));
    EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
    EXPECT_EQ(run.summary.steps, 0) << effect;
    EXPECT_THAT(run.summary.reason,
                testing::ContainsRegex("consolidation: the stiffness of " + effect +
                                       " makes the time step [0-9]+ times shorter"));
  }
}

/// Largest difference of an observable over its largest value.
double LargestDifference(const test::Run& a, const test::Run& b, const std::string& name) {
  double difference = 0;
  double largest = 0;
  for (std::size_t k = 0; k < a.states.size(); ++k) {
    difference =
        std::max(difference, std::abs(Value(a.states[k], name) - Value(b.states[k], name)));
    largest = std::max(largest, std::abs(Value(a.states[k], name)));
  }
  return difference / largest;
}

// How near with 1000 grains: StagingSlow.Adaptive* in staging_study_test.cc.
TEST(AdaptiveStaging, ReachesTheCurveInFewerSteps) {
  Scenario fixed = test::SmallTriaxial(test::HertzModel());
  fixed.test = "oedometric";
  fixed.packing = test::SmallPacking(200);
  fixed.path.clear();
  for (const double strain : {0.0, 0.005, 0.01, 0.015, 0.02, 0.015, 0.01, 0.02}) {
    fixed.path.push_back({.target = strain, .load_step = static_cast<int>(fixed.path.size())});
  }
  Scenario adaptive = fixed;
  adaptive.staging.adaptive = true;
  const test::Run a = test::RunAll(fixed);
  const test::Run b = test::RunAll(adaptive);
  ASSERT_EQ(b.summary.outcome, Outcome::kCompleted) << b.summary.reason;
  EXPECT_LT(static_cast<double>(b.summary.steps), 0.8 * static_cast<double>(a.summary.steps));
  EXPECT_LT(LargestDifference(a, b, "axial_stress"), 0.01);
  EXPECT_LT(LargestDifference(a, b, "lateral_stress"), 0.01);
  EXPECT_NEAR(Value(b.states[4], "axial_strain"), 0.02, 1e-15);
}

TEST(AdaptiveStaging, SaysWhatItUsesAndKeepsWhatIsGiven) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.path.resize(1);
  s.staging.adaptive = true;
  const Staging chosen = test::RunAll(s).summary.staging;
  EXPECT_TRUE(chosen.adaptive);
  EXPECT_EQ(*chosen.step, 0.02);
  EXPECT_EQ(*chosen.damping_settling, 0.7);
  s.staging.step = 0.001;
  s.staging.damping_settling = 0.8;
  const Staging given = test::RunAll(s).summary.staging;
  EXPECT_EQ(*given.step, 0.001);
  EXPECT_EQ(*given.damping_settling, 0.8);
}

TEST(AdaptiveStaging, DoesNotTouchARealRate) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.loading_rate = 1;
  const test::Run plain = test::RunAll(s);
  s.staging.adaptive = true;
  const test::Run same = test::RunAll(s);
  EXPECT_FALSE(same.summary.staging.adaptive);
  EXPECT_EQ(same.summary.steps, plain.summary.steps);
  EXPECT_EQ(same.states.back().values, plain.states.back().values);
}

TEST(LoadingRate, FastLoadingIsStrongerThanQuasiStatic) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  const test::Run slow = test::RunAll(s);
  s.loading_rate = 50 * *slow.summary.staging.rate;
  const test::Run fast = test::RunAll(s);
  ASSERT_EQ(fast.summary.outcome, Outcome::kCompleted);
  EXPECT_NEAR(Value(fast.states[2], "axial_strain"), 0.01, 1e-15);
  EXPECT_LT(fast.summary.steps, slow.summary.steps);
}

TEST(Failure, ATooSoftModelDivergesWithAReason) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.model.parameters["young_modulus"] = 1e4;
  const test::Run run = test::RunAll(s);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason, HasSubstr("consolidation: "));
  EXPECT_THAT(run.summary.reason,
              testing::ContainsRegex("grains [0-9]+ and [0-9]+ overlap|too short"));
}

TEST(Failure, StopIsObeyedBetweenTwoSteps) {
  std::stop_source source;
  Scenario s = test::SmallTriaxial(test::HertzModel());
  int states = 0;
  const auto summary = Simulate(
      s,
      [&](const State&) {
        ++states;
        source.request_stop();
      },
      source.get_token());
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->outcome, Outcome::kStopped);
  EXPECT_EQ(states, 1);
}

}  // namespace
}  // namespace calib::dem
