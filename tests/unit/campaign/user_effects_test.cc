// model.user_effects: what is read of a good one, and every mistake in one line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/campaign/file/derive.h"
#include "server/campaign/file/shared/formula_units.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using testing::GoodFiles;
using ::testing::HasSubstr;
using testing::ProblemsOf;
using testing::ReaderOf;
using testing::Spoiled;

constexpr const char* kDamping = R"yaml(
    my_damping:
      adds: normal_force
      formula: "c * closing_velocity * sqrt(overlap / length)"
      unit: N
      parameters:
        c: {unit: N s/m, null: 0, prior: {prior: log_uniform, min: 0.01, max: 10}, steps: [0.1, 1 N s/m]}
        length: {unit: m, default: 1 mm}
      source: "nobody 2026"
)yaml";

std::string With(const std::string& effects) {
  return Spoiled("  density: 2650 kg/m^3\n",
                 "  density: 2650 kg/m^3\n  user_effects:" + effects + "\n");
}

std::string Changed(const std::string& from, const std::string& to) {
  std::string text = kDamping;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return With(text.replace(at, from.size(), to));
}

TEST(UserEffects, AreReadWithUnitsNullsAndSteps) {
  const ReadOutcome read =
      ReadCampaign(methods::All(), With(kDamping), "c.yaml", ReaderOf(GoodFiles()));
  EXPECT_EQ(ProblemsOf(With(kDamping)), "");
  ASSERT_EQ(read.campaign.model.user_effects.size(), 1U);
  const dem::UserEffect& effect = read.campaign.model.user_effects[0];
  EXPECT_EQ(effect.info.name, "my_damping");
  EXPECT_EQ(effect.info.kind, "contact");
  EXPECT_EQ(effect.target, "normal_force");
  EXPECT_EQ(effect.info.reference, "nobody 2026");
  EXPECT_FALSE(effect.info.two_sided);
  ASSERT_EQ(effect.info.parameters.size(), 2U);
  EXPECT_EQ(effect.info.parameters[0].unit, "N s/m");
  EXPECT_EQ(effect.info.parameters[0].min, 0);
  EXPECT_EQ(effect.info.parameters[1].default_value, 1e-3);
  ASSERT_EQ(effect.info.rays.size(), 1U);
  EXPECT_THAT(effect.info.rays[0].steps, ElementsAre(0.1, 1));
  // Declared is not used.
  EXPECT_THAT(read.campaign.model.effects, ElementsAre("rolling_resistance"));
}

// The screen tries a strength before anything is known of the rest.
TEST(UserEffects, WhatHasNoDefaultIsHeldAtTheMedianOfItsPrior) {
  const std::string yaml =
      Changed("default: 1 mm", "prior: {prior: log_uniform, min: 0.1 mm, max: 10 mm}");
  EXPECT_EQ(ProblemsOf(yaml), "");
  const ReadOutcome read = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()));
  const dem::EffectInfo& effect = read.campaign.model.user_effects.at(0).info;
  ASSERT_EQ(effect.rays.size(), 1U);
  ASSERT_EQ(effect.rays[0].held.size(), 1U);
  EXPECT_EQ(effect.rays[0].held.begin()->first, effect.parameters[1].name);
  EXPECT_NEAR(effect.rays[0].held.begin()->second, 1e-3, 1e-12);
}

TEST(UserEffects, JoinTheModelLikeAnyOther) {
  std::string yaml = With(kDamping);
  yaml.replace(yaml.find("[rolling_resistance]"), 20, "[rolling_resistance, my_damping]");
  EXPECT_THAT(ProblemsOf(yaml), HasSubstr("parameters: my_damping.c has no value"));
  yaml.replace(yaml.find("parameters:\n  young"), 12, "parameters:\n  my_damping.c: default\n");
  EXPECT_THAT(ProblemsOf(yaml),
              HasSubstr("effect my_damping has no part in any of the experiments"))
      << "a dashpot, and all readings are taken at rest";
  yaml.insert(yaml.find("    role: validate"), "    loading_rate: 0.1 1/s\n");
  EXPECT_EQ(ProblemsOf(yaml), "");
}

TEST(UserEffects, AStrengthThatGoesBothWaysIsTwoSided) {
  const std::string yaml = Changed("prior: log_uniform, min: 0.01, max: 10}, steps: [0.1, 1 N s/m]",
                                   "prior: uniform, min: -1, max: 1}");
  const ReadOutcome read = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()));
  EXPECT_EQ(ProblemsOf(yaml), "");
  EXPECT_TRUE(read.campaign.model.user_effects.at(0).info.two_sided);
  const auto& steps = read.campaign.model.user_effects[0].info.rays.at(0).steps;
  EXPECT_NEAR(steps[0], 0.5, 1e-12);
  EXPECT_NEAR(steps[1], 0.8, 1e-12);
}

TEST(UserEffects, ReadingsAreAddedToAndScaled) {
  const ReadOutcome read = ReadCampaign(methods::All(), With(R"(
    penetration:
      adds: volumetric_strain
      formula: m * max(0, mean_stress - p0) / p0
      parameters:
        m: {null: 0, prior: {prior: uniform, min: -0.01, max: 0.01}}
        p0: {unit: kPa, default: 100 kPa}
    cell:
      scales: axial_stress
      formula: 1 + g
      parameters: {g: {null: 0, prior: {prior: uniform, min: -0.1, max: 0.1}}}
)"),
                                        "c.yaml", ReaderOf(GoodFiles()));
  ASSERT_TRUE(read.problems.empty()) << ToString(read.problems[0]);
  EXPECT_EQ(read.campaign.model.user_effects[0].info.kind, "measurement");
  EXPECT_EQ(read.campaign.model.user_effects[1].action, dem::FormulaAction::kScales);
}

// A fit could not take such a strength; one that was accepted once still has to load.
TEST(UserEffects, StepsOutsideThePriorAreRefusedOfNewCampaignsOnly) {
  const std::string yaml = Changed("steps: [0.1, 1 N s/m]", "steps: [0.1, 20 N s/m]");
  EXPECT_THAT(ProblemsOf(yaml), HasSubstr("steps: 20 is outside its prior, 0.01 to 10"));
  const ReadOutcome stored = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()),
                                          std::nullopt, CampaignIs::kStored);
  for (const Problem& problem : stored.problems) ADD_FAILURE() << ToString(problem);
  EXPECT_THAT(stored.campaign.model.user_effects.at(0).info.rays.at(0).steps, ElementsAre(0.1, 20));
}

// extend, diagnose and improve write campaigns that follow from this one.
TEST(UserEffects, SurviveTheTextOfADerivedCampaign) {
  const auto derived =
      Derive(methods::All(), With(kDamping),
             {.name = "joined",
              .lineage = {.parent = "c1", .purpose = "extension"},
              .effects = {"my_damping"},
              .parameters = {{"my_damping.c", {.kind = "log_uniform", .min = 0.01, .max = 10}}}});
  ASSERT_TRUE(derived.ok()) << derived.status();
  EXPECT_EQ(ProblemsOf(*derived), "") << *derived;
  const ReadOutcome read = ReadCampaign(methods::All(), *derived, "c.yaml", ReaderOf(GoodFiles()));
  const ReadOutcome parent =
      ReadCampaign(methods::All(), With(kDamping), "c.yaml", ReaderOf(GoodFiles()));
  EXPECT_THAT(read.campaign.model.effects, ElementsAre("rolling_resistance", "my_damping"));
  const dem::UserEffect& effect = read.campaign.model.user_effects.at(0);
  EXPECT_EQ(effect.formula, parent.campaign.model.user_effects.at(0).formula);
  EXPECT_EQ(effect.info.parameters.at(0).null_value, 0);
  EXPECT_EQ(effect.info.parameters.at(0).unit, "N s/m");
}

struct Mistake {
  const char* name;
  const char* from;
  const char* to;
  const char* expected;
};

class BadUserEffect : public ::testing::TestWithParam<Mistake> {};

TEST_P(BadUserEffect, IsRefusedInOneLine) {
  const Mistake& mistake = GetParam();
  const std::string problems = ProblemsOf(Changed(mistake.from, mistake.to));
  EXPECT_THAT(problems, HasSubstr(mistake.expected));
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadUserEffect,
    ::testing::Values(
        Mistake{"UnknownQuantity", "overlap /", "overlapp /",
                "c.yaml:9: model.user_effects.my_damping.formula: character 29: 'overlapp' is "
                "neither a quantity nor a parameter; did you mean 'overlap'?"},
        Mistake{"NothingLikeIt", "overlap /", "temperature /",
                "'temperature' is neither a quantity nor a parameter; allowed: axial_strain, c, "
                "closing_velocity, "},
        Mistake{"Syntax", "sqrt(overlap / length)", "sqrt(overlap / )",
                "character 39: ')' is not expected here"},
        Mistake{"Unclosed", "length)\"", "length\"", "character 45: a ')' is missing"},
        Mistake{"TwoThings", "c * closing", "c closing", "character 3: 'c' is not expected here"},
        Mistake{"Assignment", "c * closing", "c = closing",
                "character 3: '=' is not expected here"},
        Mistake{"SumOfUnits", "c * closing_velocity", "c + closing_velocity",
                "character 5: c is in kg/s, closing_velocity * sqrt(overlap / length) is in m/s: "
                "they cannot be added"},
        Mistake{"UnitOfTheResult", "sqrt(overlap / length)", "overlap / length^0.5",
                "formula: gives a quantity in kg m^1.5 s^-2, but what it adds to normal_force has "
                "to be a force (N, mN, kN)"},
        Mistake{"ArgumentWithUnit", "sqrt(overlap / length)", "exp(overlap)",
                "character 28: overlap is in m, but the argument of exp has to be a plain number"},
        Mistake{"ExponentWithUnit", "sqrt(overlap / length)", "2^overlap",
                "overlap is in m, but an exponent has to be a plain number"},
        Mistake{"DeclaredUnit", "unit: N\n", "unit: Pa\n",
                "user_effects.my_damping.unit: is Pa, but the formula has to give N"},
        Mistake{"NoSuchUnit", "unit: N s/m,", "unit: N foo/m,", "unknown unit 'foo'"},
        Mistake{"NoSuchTarget", "adds: normal_force", "adds: normal_forse",
                "my_damping.adds: 'normal_forse' cannot be changed by a formula; did you mean "
                "'normal_force'?"},
        Mistake{"BothActions", "adds: normal_force",
                "adds: normal_force\n      scales: normal_force",
                "needs exactly one of adds and scales"},
        Mistake{"NoNull", "null: 0, ", "", "none has a null"},
        Mistake{"NullIsNotNothing", "\"c * closing_velocity * sqrt(overlap / length)\"",
                "\"c * closing_velocity + normal_force\"",
                "at the null value (c = 0), but has to be 0"},
        Mistake{"NoPrior", "prior: {prior: log_uniform, min: 0.01, max: 10}, steps: [0.1, 1 N s/m]",
                "description: x", "parameters.c.prior: is missing"},
        Mistake{"NormalPrior", "prior: log_uniform, min: 0.01, max: 10",
                "prior: normal, mean: 1, sd: 1", "has to be uniform or log_uniform"},
        Mistake{"WrongSign", "null: 0,", "null: 0, sign: negative,",
                "reaches beyond the null 0, but its sign is negative"},
        Mistake{"StepAtTheNull", "steps: [0.1, 1 N s/m]", "steps: [0, 1]",
                "neither of them its null"},
        Mistake{"StepOfAnotherUnit", "1 N s/m]", "1 Pa]", "Pa is a pressure"},
        Mistake{"ShapeWithoutDefault", "default: 1 mm", "description: x",
                "needs a default or a prior"},
        Mistake{"TakenName", "my_damping:", "viscous_damping:", "in this build already"},
        Mistake{"ParameterNamedLikeAQuantity", "length: {unit", "overlap: {unit",
                "'length' is neither a quantity"},
        Mistake{"NoSuchTest",
                "source:", "tests: [triaxal]\n      source:", "no test of this build"},
        Mistake{"UnknownKey", "source:", "sauce:", "is an unknown key"},
        Mistake{"ParameterThatIsNotUsed", "sqrt(overlap / length)", "1",
                "my_damping.parameters: length does not occur in the formula"},
        Mistake{"NeverFinite", "sqrt(overlap / length)", "sqrt(0 - overlap / length)",
                "the null value"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(UserEffects, AMistakeInTheFormulaIsNoMistakeOfItsUse) {
  std::string yaml = Changed("overlap /", "overlapp /");
  yaml.replace(yaml.find("[rolling_resistance]"), 20, "[rolling_resistance, my_damping]");
  yaml.replace(yaml.find("parameters:\n  young"), 12, "parameters:\n  my_damping.c: default\n");
  const std::string problems = ProblemsOf(yaml);
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
}

TEST(FormulaUnits, FollowEveryOperation) {
  const std::map<std::string, Dimension> names = {{"F", {1, 1, -2, 0}},
                                                  {"u", {0, 1, 0, 0}},
                                                  {"k", {1, 0, -2, 0}},
                                                  {"x", {}},
                                                  {"angle", {0, 0, 0, 1}}};
  const auto unit = [&](const std::string& formula) {
    const FormulaUnits units = UnitsOf(formula, names);
    return units.problem.empty() ? SiName(units.dimension) : units.problem;
  };
  EXPECT_EQ(unit("F / u - k"), "N/m");
  EXPECT_EQ(unit("sqrt(k * F) * u^0.5"), "N");
  EXPECT_EQ(unit("k * u^(3/2) / u^(1/2)"), "N");
  EXPECT_EQ(unit("u > 0 ? F : 0"), "N");
  EXPECT_EQ(unit("max(0, F, k * u) * (u < 2 * u && x != 1)"), "N");
  EXPECT_EQ(unit("(F / F)^x * abs(-F)"), "N");
  EXPECT_EQ(unit("sin(angle) + cos(x) + tanh(F / (k * u))"), "1");
  EXPECT_EQ(unit("sign(F)"), "1");
  EXPECT_THAT(unit("F^x"), HasSubstr("raised only to a number that is written out"));
  EXPECT_THAT(unit("F > u"), HasSubstr("cannot be compared"));
  EXPECT_THAT(unit("min(F, 1)"), HasSubstr("cannot be arguments of one min"));
  EXPECT_THAT(unit("x ? F : u"), HasSubstr("outcomes of one condition"));
  EXPECT_THAT(unit("log(F)"), HasSubstr("the argument of log"));
  EXPECT_THAT(unit("F && x"), HasSubstr("a plain number"));
  EXPECT_TRUE(UnitsOf("0", names).anything);
  EXPECT_THAT(unit(std::string(5000, '(')), HasSubstr("nested too deeply"));
  EXPECT_THAT(unit(std::string(5000, '-') + "x"), HasSubstr("nested too deeply"));
}

}  // namespace
}  // namespace calib::campaign
