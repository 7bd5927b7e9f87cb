// Effects written as formulas in whole runs: against the built-in effects that they repeat, at
// their null, on any number of threads, and where they fail.
#include "tests/support/dem/user_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dem/registry/catalog.h"
#include "dem/registry/scenario_problems.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using testing::HasSubstr;
using testing::MatchesRegex;

double Value(const Scenario& scenario, const State& state, const std::string& observable) {
  const auto& names = FindTest(scenario.test)->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), observable) -
                                               names.begin())];
}

void ExpectSameCurves(const test::Run& a, const test::Run& b, double tolerance) {
  ASSERT_EQ(a.summary.outcome, Outcome::kCompleted) << a.summary.reason;
  ASSERT_EQ(b.summary.outcome, Outcome::kCompleted) << b.summary.reason;
  ASSERT_EQ(a.states.size(), b.states.size());
  for (std::size_t s = 0; s < a.states.size(); ++s) {
    for (std::size_t v = 0; v < a.states[s].values.size(); ++v) {
      const double expected = b.states[s].values[v];
      EXPECT_NEAR(a.states[s].values[v], expected, tolerance * std::abs(expected)) << s << " " << v;
    }
  }
}

Model BuiltIn(Model model, const std::string& effect, const std::map<std::string, double>& values) {
  model.effects.push_back(effect);
  for (const auto& [name, value] : values) model.parameters[effect + "." + name] = value;
  return model;
}

TEST(UserEffects, RepeatLinearCohesion) {
  const UserEffect mine = test::Formula("attraction", "2 * pi * c * (effective_radius * overlap)");
  const test::Run built_in = test::RunAll(test::SmallTriaxial(
      BuiltIn(test::LinearModel(), "linear_cohesion", {{"energy_density", 1e7}})));
  const test::Run formula =
      test::RunAll(test::SmallTriaxial(test::Joined(test::LinearModel(), mine, {1e7})));
  ExpectSameCurves(formula, built_in, 1e-9);
  const test::Run plain = test::RunAll(test::SmallTriaxial(test::LinearModel()));
  EXPECT_NE(plain.states.back().values, built_in.states.back().values);
}

TEST(UserEffects, RepeatTheNormalDashpotOfViscousDamping) {
  const UserEffect mine =
      test::Formula("normal_force",
                    "max(2 * c * sqrt(effective_mass * normal_stiffness) * closing_velocity, "
                    "min(normal_force, 0) - normal_force)");
  Scenario scenario;
  scenario.model = test::LinearModel();
  scenario.test = "collision";
  scenario.settings = {{"radius", 2e-3}, {"partner_radius", 3e-3}, {"impact_angle", 0}};
  scenario.path = {{.target = 0.1, .load_step = 0}, {.target = 1, .load_step = 1}};
  scenario.model.parameters["friction_coefficient"] = 0;
  Scenario built_in = scenario;
  built_in.model = BuiltIn(scenario.model, "viscous_damping", {{"ratio", 0.3}});
  Scenario formula = scenario;
  formula.model = test::Joined(scenario.model, mine, {0.3});
  const test::Run a = test::RunAll(formula);
  const test::Run b = test::RunAll(built_in);
  ASSERT_EQ(a.states.size(), 2U) << a.summary.reason;
  for (std::size_t s = 0; s < 2; ++s) {
    const double restitution = Value(scenario, b.states[s], "normal_restitution");
    EXPECT_LT(restitution, 0.5);
    EXPECT_NEAR(Value(scenario, a.states[s], "normal_restitution"), restitution, 1e-9);
    EXPECT_NEAR(Value(scenario, a.states[s], "contact_duration"),
                Value(scenario, b.states[s], "contact_duration"), 1e-12);
  }
}

TEST(UserEffects, RepeatTheLoadCellsError) {
  const UserEffect mine = test::Formula("axial_stress", "c");
  Scenario scenario = test::SmallTriaxial(test::LinearModel());
  scenario.model = test::Joined(scenario.model, mine, {3e4});
  Scenario built_in = test::SmallTriaxial(
      BuiltIn(test::LinearModel(), "load_cell_error", {{"offset", 3e4}, {"gain", 0}}));
  ExpectSameCurves(test::RunAll(scenario), test::RunAll(built_in), 1e-12);
}

TEST(UserEffects, DerivedReadingsFollowAndCanBeChangedThemselves) {
  const Scenario plain = test::SmallTriaxial(test::LinearModel());
  Scenario changed = plain;
  UserEffect stress = test::Formula("lateral_stress", "c * volumetric_strain");
  UserEffect ratio = test::Formula("stress_ratio", "1 + c", FormulaAction::kScales);
  ratio.info.name = "other";
  changed.model = test::Joined(test::Joined(plain.model, stress, {1e6}), ratio, {0.1});
  const test::Run a = test::RunAll(changed);
  const test::Run b = test::RunAll(plain);
  ASSERT_EQ(a.states.size(), b.states.size()) << a.summary.reason;
  for (std::size_t s = 0; s < a.states.size(); ++s) {
    const auto now = [&](const char* name) { return Value(plain, a.states[s], name); };
    const auto before = [&](const char* name) { return Value(plain, b.states[s], name); };
    const double lateral = before("lateral_stress") + 1e6 * before("volumetric_strain");
    EXPECT_NEAR(now("lateral_stress"), lateral, 1e-9 * lateral);
    EXPECT_EQ(now("axial_stress"), before("axial_stress"));
    EXPECT_NEAR(now("deviatoric_stress"), before("axial_stress") - lateral, 1e-4);
    EXPECT_NEAR(now("stress_ratio"), 1.1 * before("axial_stress") / lateral, 1e-9);
  }
}

TEST(UserEffects, AtTheirNullChangeNoBit) {
  for (const Model& base : {test::HertzModel(), test::LinearModel()}) {
    const test::Run plain = test::RunAll(test::SmallTriaxial(base));
    for (const UserEffect& effect :
         {test::Formula("normal_force", "c * closing_velocity * sqrt(overlap)"),
          test::Formula("normal_force", "c * normal_force * sliding_distance"),
          test::Formula("attraction", "c * overlap"),
          test::Formula("shear_force", "c * sliding_velocity"),
          test::Formula("normal_force", "1 + c * axial_strain", FormulaAction::kScales),
          test::Formula("friction_coefficient", "(mean_stress / 100000)^c", FormulaAction::kScales),
          test::Formula("axial_stress", "c * deviatoric_stress"),
          test::Formula("stress_ratio", "1 + c", FormulaAction::kScales)}) {
      const test::Run run = test::RunAll(test::SmallTriaxial(test::Joined(base, effect, {0})));
      ASSERT_EQ(run.states.size(), plain.states.size()) << effect.formula << run.summary.reason;
      for (std::size_t s = 0; s < run.states.size(); ++s) {
        EXPECT_EQ(run.states[s].values, plain.states[s].values) << effect.formula << " " << s;
      }
    }
  }
}

TEST(UserEffects, DeclaredButNotUsedChangeNothing) {
  Model model = test::LinearModel();
  model.user_effects.push_back(test::Formula("normal_force", "c * nonsense("));
  EXPECT_EQ(test::RunAll(test::SmallTriaxial(model)).states.back().values,
            test::RunAll(test::SmallTriaxial(test::LinearModel())).states.back().values);
}

TEST(UserEffects, ThreadsChangeNoBit) {
  Scenario s = test::SmallTriaxial(test::Joined(
      test::LinearModel(),
      test::Formula(
          "friction_coefficient",
          "1 + c * (mean_stress / 200000)^1.3 * exp(-sliding_distance / effective_radius)",
          FormulaAction::kScales),
      {0.4}));
  s.packing = test::SmallPacking(250);
  s.path = {{.target = 0, .load_step = 0}, {.target = 0.002, .load_step = 1}};
  const test::Run one = test::RunAll(s);
  ASSERT_EQ(one.summary.outcome, Outcome::kCompleted) << one.summary.reason;
  for (const int threads : {2, 3}) {
    s.threads = threads;
    const test::Run many = test::RunAll(s);
    ASSERT_EQ(many.states.size(), one.states.size());
    for (std::size_t k = 0; k < one.states.size(); ++k) {
      EXPECT_EQ(many.states[k].values, one.states[k].values);
    }
  }
}

TEST(UserEffects, MoreFrictionAtHigherStrainIsSeenInTheCurve) {
  const Scenario plain = test::SmallTriaxial(test::LinearModel());
  Scenario s = plain;
  s.model = test::Joined(
      plain.model,
      test::Formula("friction_coefficient", "1 + c * axial_strain", FormulaAction::kScales), {100});
  const test::Run a = test::RunAll(s);
  const test::Run b = test::RunAll(plain);
  EXPECT_EQ(a.states[0].values, b.states[0].values) << "strains are zero until loading begins";
  EXPECT_GT(Value(s, a.states[2], "stress_ratio"), Value(s, b.states[2], "stress_ratio"));
}

TEST(UserEffects, AValueThatIsNotFiniteStopsTheRunAndIsNamed) {
  Scenario s = test::SmallTriaxial(
      test::Joined(test::LinearModel(),
                   test::Formula("normal_force", "c * sqrt(0.004 - axial_strain)"), {1e-3}));
  const test::Run run = test::RunAll(s);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  ASSERT_EQ(run.states.size(), 1U);
  EXPECT_THAT(run.summary.reason,
              MatchesRegex("path point 1 .*grains [0-9]+ and [0-9]+: effect mine: c . "
                           "sqrt.0.004 - axial_strain. is -?nan at axial_strain = 0.004.*, c = "
                           "0.001"));
  const std::string once = run.summary.reason;
  s.threads = 3;
  EXPECT_EQ(test::RunAll(s).summary.reason, once);
  s.model =
      test::Joined(test::LinearModel(), test::Formula("axial_stress", "c / axial_strain"), {1});
  const test::Run reading = test::RunAll(s);
  EXPECT_EQ(reading.summary.outcome, Outcome::kDiverged);
  EXPECT_TRUE(reading.states.empty());
  EXPECT_THAT(reading.summary.reason, HasSubstr("is inf at axial_strain = 0, c = 1"));
}

TEST(UserEffects, CollisionsNameTheImpact) {
  Scenario s;
  s.model = test::Joined(test::LinearModel(),
                         test::Formula("normal_force", "c * sqrt(0.5 - closing_velocity)"), {1});
  s.test = "collision";
  s.settings = {{"radius", 2e-3}, {"impact_angle", 0}};
  s.path = {{.target = 0.1, .load_step = 0}, {.target = 1, .load_step = 1}};
  const test::Run run = test::RunAll(s);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason, HasSubstr("load step 1"));
  EXPECT_THAT(run.summary.reason, HasSubstr("closing_velocity = "));
}

TEST(UserEffects, AreRefusedWhereTheyHaveNoMeaning) {
  const auto first = [](const Scenario& s) {
    const auto problems = ScenarioProblems(s);
    return problems.empty() ? "" : problems.front();
  };
  Scenario s;
  s.model =
      test::Joined(test::LinearModel(), test::Formula("normal_force", "c * mean_stress"), {1});
  s.test = "collision";
  s.settings = {{"radius", 2e-3}, {"impact_angle", 0}};
  s.path = {{.target = 0.1, .load_step = 0}};
  EXPECT_THAT(first(s), HasSubstr("which test collision does not have"));
  s = test::SmallTriaxial(
      test::Joined(test::LinearModel(), test::Formula("axial_stress", "c"), {1}));
  s.test = "isotropic";
  s.path = {{.target = 3e5, .load_step = 0}};
  EXPECT_THAT(first(s), HasSubstr("by which test isotropic is driven"));
  s = test::SmallTriaxial(test::LinearModel());
  for (const char* name : {"a", "b", "d", "e", "f"}) {
    UserEffect effect = test::Formula("normal_force", "c");
    effect.info.name = name;
    s.model = test::Joined(s.model, effect, {1});
  }
  EXPECT_THAT(first(s), HasSubstr("at most 4"));
}

}  // namespace
}  // namespace calib::dem
