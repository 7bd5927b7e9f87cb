// Formulas of users: syntax, evaluation on many threads, and what a contact's formula sees and
// does.
#include "dem/formula/formula.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <thread>

#include "dem/dynamics/contact_model.h"
#include "dem/elementary/functions.h"
#include "dem/formula/user_effect.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"
#include "tests/support/dem/user_effects.h"

namespace calib::dem {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

double Value(const std::string& text, const std::vector<double>& values) {
  const Formula formula(text, {"a", "b", "ab"});
  std::vector<double> row;
  for (const int i : formula.used()) row.push_back(values[static_cast<std::size_t>(i)]);
  double value = 0;
  formula.Evaluate(row.data(), 1, &value);
  return value;
}

TEST(Formula, FollowsTheUsualPrecedence) {
  const std::vector<double> v = {3, 2, 7};
  EXPECT_EQ(Value("a + b * ab", v), 17);
  EXPECT_EQ(Value("-a^b", v), -9);
  EXPECT_EQ(Value("b^a^b", v), 512);
  EXPECT_EQ(Value("b^-1", v), 0.5);
  EXPECT_EQ(Value("(-a)^-b", v), 1.0 / 9);
  EXPECT_EQ(Value("a > b && ab >= 7 ? a : b", v), 3);
  EXPECT_EQ(Value("max(a, b, ab) - min(a, b) + abs(-a) * sign(-b)", v), 2);
  EXPECT_DOUBLE_EQ(Value("sqrt(a) + exp(b) + log(ab) + tanh(a) + sin(pi * a / 6) + cos(0)", v),
                   std::sqrt(3.0) + std::exp(2.0) + std::log(7.0) + std::tanh(3.0) + 2.0);
}

// Powers, exponentials and the like are those of dem/elementary, not of the machine's libm.
TEST(Formula, ComputesTheSameBitsOnEveryProcessor) {
  for (double x = 0.3; x < 9; x += 0.7) {
    EXPECT_EQ(Value("a^b", {x, 33.3, 0}), Pow(x, 33.3)) << x;
    EXPECT_EQ(Value("log(a) + tanh(b)", {x, 0.4, 0}), Log(x) + HyperbolicTangent(0.4)) << x;
  }
}

TEST(Formula, KnowsWhichNamesItMentions) {
  EXPECT_THAT(Formula("ab + 1", {"a", "b", "ab"}).used(), ElementsAre(2));
  EXPECT_THAT(Formula("a*b", {"a", "b", "ab"}).used(), ElementsAre(0, 1));
  EXPECT_THAT(Formula("exp(1)", {"e", "x"}).used(), ElementsAre());
}

TEST(Formula, WhatIsNotDefinedComesOutAsSuch) {
  EXPECT_TRUE(std::isnan(Value("sqrt(-a)", {3, 2, 7})));
  EXPECT_TRUE(std::isinf(Value("a / (b - 2)", {3, 2, 7})));
}

TEST(Formula, MistakesHaveAPlace) {
  const auto check = [](const std::string& text) { return Formula::Check(text, {"a", "b"}); };
  EXPECT_EQ(check("a + sqrt(b)").message, "");
  EXPECT_EQ(check("a + c").position, 5);
  EXPECT_THAT(check("a + c").message, HasSubstr("c"));
  for (const char* wrong :
       {"", " ", "a +", "a b", "(a", "a)", "a = 3", "a, b", "a; b", "a # b", "\"a\"", "sqrt()",
        "sqrt(a, b)", "rnd(a)", "a +* b", "a\nb", "sum(a, b)", "\xc3\xa4"}) {
    EXPECT_NE(check(wrong).message, "") << wrong;
  }
  EXPECT_EQ(check("a = 3").position, 3);
  EXPECT_EQ(check("a >= b").message, "");
}

TEST(Formula, ManyThreadsGetTheSameBits) {
  const Formula formula("sqrt(a) * b^1.3 + exp(-a / b)", {"a", "b"});
  std::vector<double> rows;
  for (int k = 0; k < 2000; ++k) rows.insert(rows.end(), {0.1 * k + 0.01, 1.0 + k % 7});
  std::vector<double> expected(2000);
  formula.Evaluate(rows.data(), 2000, expected.data());
  std::vector<std::vector<double>> results(4, std::vector<double>(2000));
  {
    std::vector<std::jthread> threads;
    for (auto& result : results) {
      threads.emplace_back([&] {
        for (int k = 0; k < 2000; k += 20) {
          formula.Evaluate(&rows[static_cast<std::size_t>(2 * k)], 20,
                           &result[static_cast<std::size_t>(k)]);
        }
      });
    }
  }
  for (const auto& result : results) EXPECT_EQ(result, expected);
}

TEST(UserEffectProblems, NameWhatIsWrong) {
  EXPECT_THAT(UserEffectProblems(test::Formula("normal_force", "c * overlap")), ElementsAre());
  const auto first = [](const UserEffect& effect) { return UserEffectProblems(effect).at(0); };
  EXPECT_THAT(first(test::Formula("normal_fors", "c")), HasSubstr("cannot be changed"));
  EXPECT_THAT(first(test::Formula("axial_strain", "c")), HasSubstr("cannot be changed"));
  EXPECT_THAT(first(test::Formula("friction_coefficient", "c")), HasSubstr("scaled"));
  EXPECT_THAT(first(test::Formula("attraction", "c", FormulaAction::kScales)), HasSubstr("scaled"));
  EXPECT_THAT(first(test::Formula("normal_force", "c * axial_stress")), HasSubstr("character 5"));
  EXPECT_THAT(first(test::Formula("normal_force", "c * shear_force")), HasSubstr("only"));
  EXPECT_THAT(first(test::Formula("normal_force", "overlap", FormulaAction::kAdds, {"overlap"})),
              HasSubstr("name of a quantity"));
  UserEffect taken = test::Formula("normal_force", "c");
  taken.info.name = "linear_cohesion";
  EXPECT_THAT(first(taken), HasSubstr("already"));
}

TEST(UserEffectProblems, NullHasToRemoveTheEffect) {
  EXPECT_EQ(NullProblem(test::Formula("normal_force", "c * overlap")), "");
  EXPECT_THAT(NullProblem(test::Formula("normal_force", "(1 + c) * normal_force")),
              HasSubstr("at the null value (c = 0), but has to be 0"));
  EXPECT_EQ(NullProblem(test::Formula("normal_force", "1 + c", FormulaAction::kScales)), "");
  EXPECT_THAT(NullProblem(test::Formula("normal_force", "c", FormulaAction::kScales)),
              HasSubstr("has to be 1"));
  for (const char* zero : {"overlap", "sliding_distance", "closing_velocity", "axial_strain"}) {
    const std::string name = zero;
    EXPECT_THAT(NullProblem(test::Formula("normal_force", "c > 0 ? c / " + name + " : 0")),
                HasSubstr("is not finite where " + name + " is zero"));
    EXPECT_EQ(NullProblem(test::Formula("normal_force", "c > 0 ? c / max(" + name + ", 1e-9) : 0")),
              "");
  }
  EXPECT_THAT(NullProblem(test::Formula("normal_force", "c * log(-overlap)")),
              HasSubstr("at the null value"));  // 0 * NaN
  EXPECT_THAT(NullProblem(test::Formula("normal_force", "c > 0 ? c * log(-overlap) : 0")),
              HasSubstr("not finite"));
}

/// A pair of different grains, closing and sliding, every lane alike.
ContactBlock Pair(double dt = 1e-6) {
  ContactBlock b{};
  b.count = kBlock;
  b.dt = dt;
  b.sliding_friction = 0.5;
  for (int k = 0; k < kBlock; ++k) {
    b.pair[k] = k;
    b.radius_i[k] = 2e-3;
    b.radius_j[k] = 3e-3;
    b.dx[k] = 5e-3 - 1e-5;
    b.vx[k] = -0.2;
    b.vy[k] = 0.1;
  }
  return b;
}

double Added(const std::string& formula, double c = 1) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  const ContactModel joined = ContactModelOf(
      test::Joined(test::LinearModel(), test::Formula("normal_force", formula), {c}));
  ContactBlock without = Pair();
  ContactBlock with = Pair();
  plain.Evaluate(without);
  joined.Evaluate(with);
  EXPECT_FALSE(joined.Fault());
  return with.normal_force[7] - without.normal_force[7];
}

TEST(FormulaKernel, SeesEveryQuantityOfTheContact) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  ContactBlock b = Pair();
  plain.Evaluate(b);
  const double mass = 4.0 / 3.0 * std::acos(-1.0) * test::LinearModel().density;
  const double m1 = mass * 8e-9;
  const double m2 = mass * 27e-9;
  const double slide = std::abs(b.slip_y[0]);
  const std::vector<std::pair<std::string, double>> expected = {
      {"overlap", 1e-5},
      {"closing_velocity", 0.2},
      {"sliding_velocity", slide / 1e-6},
      {"sliding_distance", slide},
      {"normal_force", b.normal_force[0]},
      {"normal_stiffness", b.normal_stiffness[0]},
      {"tangential_stiffness", b.tangential_stiffness[0]},
      {"friction_coefficient", 0.5},
      {"effective_radius", 1.2e-3},
      {"smaller_radius", 2e-3},
      {"larger_radius", 3e-3},
      {"effective_mass", m1 * m2 / (m1 + m2)}};
  EXPECT_EQ(expected.size() + 1, ContactQuantities().size());  // shear_force: see below
  for (const auto& [name, value] : expected) {
    // Scaled so that what is added does not drown in the force of the law.
    EXPECT_NEAR(Added("c * " + name, 1e3 / value), 1e3, 1e-6) << name;
  }
}

TEST(FormulaKernel, SeesTheStage) {
  UserEffect effect = test::Formula(
      "normal_force",
      "c * (mean_stress + 10 * deviatoric_stress + 100 * axial_strain + 1000 * volumetric_strain + "
      "1e4 * porosity)");
  const ContactModel model = ContactModelOf(test::Joined(test::LinearModel(), effect, {1}));
  ASSERT_NE(model.stage(), nullptr);
  *model.stage() = {.mean_stress = 1,
                    .deviatoric_stress = 2,
                    .axial_strain = 3,
                    .volumetric_strain = 4,
                    .porosity = 5};
  const ContactModel plain = ContactModelOf(test::LinearModel());
  EXPECT_EQ(plain.stage(), nullptr);
  ContactBlock with = Pair();
  ContactBlock without = Pair();
  model.Evaluate(with);
  plain.Evaluate(without);
  EXPECT_NEAR(with.normal_force[0] - without.normal_force[0], 54321, 1e-6);
}

TEST(FormulaKernel, AttractionLeavesTheSlidingLimit) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  const ContactModel joined =
      ContactModelOf(test::Joined(test::LinearModel(), test::Formula("attraction", "c"), {0.3}));
  ContactBlock without = Pair();
  ContactBlock with = Pair();
  plain.Evaluate(without);
  joined.Evaluate(with);
  EXPECT_NEAR(with.normal_force[0], without.normal_force[0] - 0.3, 1e-12);
  EXPECT_NEAR(with.sliding_limit[0], without.sliding_limit[0], 1e-12);
}

TEST(FormulaKernel, FrictionIsScaledAndNeverNegative) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  ContactBlock without = Pair();
  plain.Evaluate(without);
  for (const auto& [c, factor] : std::vector<std::pair<double, double>>{{0.5, 1.5}, {-3, 0}}) {
    const ContactModel joined = ContactModelOf(
        test::Joined(test::LinearModel(),
                     test::Formula("friction_coefficient", "1 + c", FormulaAction::kScales), {c}));
    ContactBlock with = Pair();
    joined.Evaluate(with);
    EXPECT_NEAR(with.sliding_limit[0], factor * without.sliding_limit[0], 1e-12);
  }
}

TEST(FormulaKernel, ShearForceOpposesTheSlidingUpToTheLimit) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  ContactBlock without = Pair();
  plain.Evaluate(without);
  ASSERT_LT(without.fy[0], 0);
  const double limit = without.sliding_limit[0];
  for (const double c : {0.1, 100.0}) {
    const ContactModel joined = ContactModelOf(test::Joined(
        test::LinearModel(), test::Formula("shear_force", "c * sliding_velocity"), {c}));
    ContactBlock with = Pair();
    joined.Evaluate(with);
    EXPECT_NEAR(with.fy[0], -std::min(-without.fy[0] + c * 0.1, limit), 1e-3 * limit) << c;
  }
}

TEST(FormulaKernel, VelocitiesDoNothingDuringConsolidation) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  const ContactModel joined = ContactModelOf(test::Joined(
      test::LinearModel(), test::Formula("normal_force", "c * closing_velocity"), {1}));
  ContactBlock without = Pair();
  ContactBlock with = Pair();
  without.viscous = with.viscous = 0;
  plain.Evaluate(without);
  joined.Evaluate(with);
  EXPECT_EQ(with.normal_force[0], without.normal_force[0]);
}

// The step of an explicit scheme has to know what a formula stiffens and damps.
TEST(FormulaKernel, SlopesJoinStiffnessAndDamping) {
  const auto evaluated = [](const UserEffect& effect, double c) {
    const ContactModel model = ContactModelOf(test::Joined(test::LinearModel(), effect, {c}));
    ContactBlock b = Pair(0);
    model.Evaluate(b);
    return std::array<double, 3>{b.normal_stiffness[0], b.normal_damping[0],
                                 b.tangential_damping[0]};
  };
  const auto plain = evaluated(test::Formula("normal_force", "c * overlap"), 0);
  EXPECT_NEAR(evaluated(test::Formula("normal_force", "c * overlap"), 1e5)[0] - plain[0], 1e5, 1);
  EXPECT_NEAR(evaluated(test::Formula("normal_force", "c * normal_force"), 1)[0], 2 * plain[0],
              1e-6 * plain[0]);
  EXPECT_NEAR(evaluated(test::Formula("normal_force", "1 + c", FormulaAction::kScales), 1)[0],
              2 * plain[0], 1e-6 * plain[0]);
  EXPECT_EQ(evaluated(test::Formula("attraction", "c * overlap"), 1e5), plain);
  EXPECT_NEAR(evaluated(test::Formula("normal_force", "c * closing_velocity"), 7)[1], 7, 1e-6);
  EXPECT_NEAR(evaluated(test::Formula("shear_force", "c * sliding_velocity"), 7)[2], 7, 1e-6);
}

TEST(FormulaKernel, KeepsWhatIsNotFiniteToItself) {
  const ContactModel plain = ContactModelOf(test::LinearModel());
  const ContactModel joined = ContactModelOf(test::Joined(
      test::LinearModel(), test::Formula("normal_force", "c * sqrt(0.000015 - overlap)"), {2}));
  ContactBlock without = Pair();
  ContactBlock with = Pair();
  for (ContactBlock* b : {&without, &with}) {
    for (const int k : {9, 4, 20}) b->dx[k] = 5e-3 - 2e-5;
  }
  plain.Evaluate(without);
  joined.Evaluate(with);
  EXPECT_EQ(with.normal_force[4], without.normal_force[4]);
  const auto fault = joined.Fault();
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->pair, 4);
  EXPECT_THAT(fault->what, HasSubstr("effect mine: c * sqrt(0.000015 - overlap) is "));
  EXPECT_THAT(fault->what, HasSubstr("overlap = 2e-05, c = 2"));
}

}  // namespace
}  // namespace calib::dem
