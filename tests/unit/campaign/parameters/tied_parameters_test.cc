// Parameters that follow from others: read, refused, and what they make of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/campaign/file/derive.h"
#include "server/campaign/model/race.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using testing::GoodFiles;
using ::testing::HasSubstr;
using testing::ProblemsOf;
using testing::ReaderOf;

// The good campaign with rolling and twisting resistance; young_modulus, friction_angle,
// rolling_resistance.stiffness and .friction are calibrated, and then these.
std::string WithTwisting(const std::string& twisting) {
  std::string yaml = testing::GoodYaml();
  const auto replace = [&yaml](const std::string& from, const std::string& to) {
    const std::size_t at = yaml.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    yaml.replace(at, from.size(), to);
  };
  replace("effects: [rolling_resistance]", "effects: [rolling_resistance, twisting_resistance]");
  replace("experiments:\n", twisting + "experiments:\n");
  return yaml;
}

const std::string kEqual =
    "  twisting_resistance.stiffness: {equal_to: rolling_resistance.stiffness}\n"
    "  twisting_resistance.friction: {equal_to: \"0.5 * rolling_resistance.friction\"}\n";

Campaign ReadTied(const std::string& yaml, CampaignIs is = CampaignIs::kNew) {
  const ReadOutcome outcome =
      ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()), std::nullopt, is);
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  return outcome.campaign;
}

std::vector<std::string> NamesOfTied(const Campaign& campaign) {
  std::vector<std::string> names;
  for (const TiedParameter& tied : campaign.tied) names.push_back(tied.name);
  return names;
}

TEST(TiedParameters, HaveNoPriorAndGetTheirValuesInARun) {
  const Campaign c = ReadTied(WithTwisting(kEqual));
  EXPECT_EQ(c.parameters.size(), 4U);
  EXPECT_THAT(NamesOfTied(c),
              ElementsAre("twisting_resistance.stiffness", "twisting_resistance.friction"));
  const dem::Scenario run = MakeScenario(c, c.experiments[0], {{1e9, 0.5, 0.25, 0.5}, 0});
  EXPECT_EQ(run.model.parameters.at("twisting_resistance.stiffness"), 0.25);
  EXPECT_EQ(run.model.parameters.at("twisting_resistance.friction"), 0.25);
  EXPECT_EQ(run.model.parameters.at("rolling_resistance.friction"), 0.5);
}

TEST(TiedParameters, MayFollowFromFixedAndTiedOnesInAnyOrder) {
  const Campaign c = ReadTied(WithTwisting(
      "  twisting_resistance.stiffness: {equal_to: \"twisting_resistance.friction^2\"}\n"
      "  twisting_resistance.friction: {equal_to: \"min(poisson_ratio, "
      "2e0*rolling_resistance.friction)\"}\n"));
  EXPECT_THAT(NamesOfTied(c),
              ElementsAre("twisting_resistance.friction", "twisting_resistance.stiffness"));
  const dem::Model at_most = ModelOf(c, c.experiments[0], std::vector<double>{1e9, 0.5, 0.25, 0.5});
  EXPECT_EQ(at_most.parameters.at("twisting_resistance.friction"), 0.2);
  const dem::Model below = ModelOf(c, c.experiments[0], std::vector<double>{1e9, 0.5, 0.25, 0.05});
  EXPECT_EQ(below.parameters.at("twisting_resistance.friction"), 0.1);
  EXPECT_DOUBLE_EQ(below.parameters.at("twisting_resistance.stiffness"), 0.01);
}

TEST(TiedParameters, StayInWhatIsDerived) {
  const std::string parent = WithTwisting(kEqual);
  const auto extension = Derive(methods::All(), parent,
                                {.name = "sand + adhesion",
                                 .lineage = {.parent = "c1", .purpose = "extension"},
                                 .effects = {"adhesion_jkr"},
                                 .parameters = {{"adhesion_jkr.work_of_adhesion",
                                                 {.kind = "log_uniform", .min = 1e-3, .max = 1}}}});
  ASSERT_TRUE(extension.ok());
  const Campaign extended = ReadTied(*extension);
  EXPECT_EQ(extended.tied.size(), 2U);
  EXPECT_EQ(extended.parameters.size(), 5U);

  const auto design = Derive(
      methods::All(), parent,
      {.name = "design",
       .lineage = {.parent = "c1", .purpose = "design"},
       .parameters = {{"load_cell_error.gain", {.kind = "uniform", .min = -0.3, .max = 0.3}}},
       .rows = {{.like = 0,
                 .values = {{"young_modulus", 1e9},
                            {"friction_angle", 0.5},
                            {"rolling_resistance.stiffness", 0.3},
                            {"rolling_resistance.friction", 0.4},
                            {"load_cell_error.gain", 0}}}},
       .race = std::vector<std::string>{"load_cell_error"}});
  ASSERT_TRUE(design.ok());
  const Campaign runs = ReadTied(*design);
  const Eigen::VectorXd row = runs.table->parameters.row(0);
  const dem::Model model =
      ModelOf(runs, runs.experiments[0], {row.data(), static_cast<std::size_t>(row.size())});
  EXPECT_EQ(model.parameters.at("twisting_resistance.stiffness"), 0.3);
  EXPECT_EQ(model.parameters.at("twisting_resistance.friction"), 0.2);
  EXPECT_EQ(model.parameters.count("load_cell_error.gain"), 0U);
}

struct WrongTie {
  const char* name;
  const char* ties;
  const char* expected;  // behind "c.yaml:LINE: parameters."
};

class WrongTies : public ::testing::TestWithParam<WrongTie> {};

TEST_P(WrongTies, AreRefusedInOneSentence) {
  const std::string problems = ProblemsOf(WithTwisting(GetParam().ties));
  EXPECT_THAT(problems, HasSubstr(std::string(": parameters.") + GetParam().expected + "\n"));
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
}

INSTANTIATE_TEST_SUITE_P(
    All, WrongTies,
    ::testing::Values(
        WrongTie{"Itself",
                 "  twisting_resistance.stiffness: {equal_to: twisting_resistance.stiffness}\n"
                 "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stiffness: is tied to itself; give it a prior or a fixed "
                 "value"},
        WrongTie{
            "Circle",
            "  twisting_resistance.stiffness: {equal_to: \"1 * twisting_resistance.friction\"}\n"
            "  twisting_resistance.friction: {equal_to: \"1 * twisting_resistance.stiffness\"}\n",
            "twisting_resistance.stiffness: is tied to itself by way of others: "
            "twisting_resistance.stiffness follows from twisting_resistance.friction follows "
            "from twisting_resistance.stiffness; one of them needs a prior or a fixed value"},
        WrongTie{
            "Unknown",
            "  twisting_resistance.stiffness: {equal_to: \"2 * rolling_resistance.stifness\"}\n"
            "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
            "twisting_resistance.stiffness: 'rolling_resistance.stifness' is neither "
            "calibrated nor fixed here; did you mean 'rolling_resistance.stiffness'?"},
        WrongTie{
            "NoFormula",
            "  twisting_resistance.stiffness: {equal_to: \"2 * (rolling_resistance.stiffness\"}"
            "\n  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
            "twisting_resistance.stiffness: '2 * (rolling_resistance.stiffness': the formula "
            "cannot be read at ')'"},
        WrongTie{"Number",
                 "  twisting_resistance.stiffness: {equal_to: 0.3}\n"
                 "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stiffness: '0.3' names no parameter; a number belongs into "
                 "model.fixed"},
        WrongTie{"OtherKind",
                 "  twisting_resistance.stiffness: {equal_to: young_modulus}\n"
                 "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stiffness: is a rotational stiffness or moment (N m/rad, N "
                 "m), but young_modulus is a pressure (Pa, kPa, MPa, GPa); write what one is of "
                 "the other, e.g. \"2 * "
                 "young_modulus\" in SI units"},
        WrongTie{
            "OutOfRange",
            "  twisting_resistance.stiffness: {equal_to: \"rolling_resistance.stiffness - "
            "0.5\"}\n"
            "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
            "twisting_resistance.stiffness: is -0.5 where rolling_resistance.stiffness = 0 (a "
            "corner, an edge or the middle of the prior); allowed: between 0 and 1e+09 N m/rad"},
        WrongTie{"Undefined",
                 "  twisting_resistance.stiffness: {equal_to: \"1 / rolling_resistance.stiffness\"}"
                 "\n  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stiffness: has no finite value where "
                 "rolling_resistance.stiffness = 0 (a corner, an edge or the middle of the prior); "
                 "allowed: between 0 and 1e+09 N m/rad"},
        WrongTie{"PriorToo",
                 "  twisting_resistance.stiffness: {equal_to: rolling_resistance.stiffness, min: "
                 "0}\n"
                 "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stiffness.min: has no place beside equal_to: what follows "
                 "from others is not inferred"},
        WrongTie{"UnknownTied",
                 "  twisting_resistance.stifness: {equal_to: poisson_ratio}\n"
                 "  twisting_resistance.stiffness: {equal_to: poisson_ratio}\n"
                 "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n",
                 "twisting_resistance.stifness: is not a parameter of hertz_mindlin with "
                 "rolling_resistance, twisting_resistance; did you mean "
                 "'twisting_resistance.stiffness'?"}),
    [](const auto& one) { return one.param.name; });

TEST(TiedParameters, AreNotFixedToo) {
  std::string yaml = WithTwisting(kEqual);
  yaml.replace(yaml.find("{poisson_ratio: 0.2}"), 20,
               "{poisson_ratio: 0.2, twisting_resistance.friction: 0.1}");
  EXPECT_THAT(ProblemsOf(yaml), HasSubstr("twisting_resistance.friction: is both tied and fixed; "
                                          "keep one of them\n"));
}

TEST(TiedParameters, OnlyWhereTheConstraintsAreMet) {
  std::string yaml = WithTwisting(
      "  twisting_resistance.stiffness: {equal_to: \"rolling_resistance.friction - "
      "rolling_resistance.stiffness\"}\n"
      "  twisting_resistance.friction: {equal_to: rolling_resistance.friction}\n");
  EXPECT_THAT(ProblemsOf(yaml), HasSubstr("is -0.5 where rolling_resistance.stiffness = 0.5, "
                                          "rolling_resistance.friction = 0 "));
  yaml.replace(
      yaml.find("noise: given"), 12,
      "constraints: [rolling_resistance.stiffness <= 1 N m/rad * rolling_resistance.friction]\n"
      "noise: given");
  EXPECT_EQ(ProblemsOf(yaml), "");
}

}  // namespace
}  // namespace calib::campaign
