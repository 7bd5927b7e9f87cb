// Settings of experiments as parameters: read, refused, and what they make of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <variant>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/run_settings.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using testing::GoodFiles;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProblemsOf;
using testing::ReaderOf;
using testing::Spoiled;

// The good campaign with further lines under parameters.
std::string WithLines(const std::string& lines) {
  return Spoiled("experiments:\n", lines + "experiments:\n");
}

std::string Replaced(std::string yaml, const std::string& from, const std::string& to) {
  const std::size_t at = yaml.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return yaml.replace(at, from.size(), to);
}

Campaign ReadGood(const std::string& yaml) {
  const ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  return outcome.campaign;
}

const std::string kPressure =
    "  tx02.confining_pressure: {prior: uniform, min: 0.15 MPa, max: 0.25 MPa, nuisance: true}\n";

// The first four are those of the good campaign.
RunOf RunWith(std::vector<double> further, int stream = 0) {
  std::vector<double> values = {1e9, 0.5, 0.25, 0.5};
  values.insert(values.end(), further.begin(), further.end());
  return {.values = values, .stream = stream};
}

TEST(CalibratedSettings, AreOfTheExperimentTheyName) {
  const Campaign c = ReadGood(WithLines(kPressure));
  ASSERT_EQ(c.parameters.size(), 5U);
  EXPECT_EQ(c.parameters[4].unit, "Pa");
  EXPECT_TRUE(c.parameters[4].nuisance);
  EXPECT_FALSE(c.parameters[3].nuisance);
  ASSERT_TRUE(c.parameters[4].setting.has_value());
  EXPECT_THAT(c.parameters[4].setting->experiments, ElementsAre("tx02"));
  const RunOf run = RunWith({2.1e5});
  EXPECT_EQ(MakeScenario(c, c.experiments[0], run).settings.at("confining_pressure"), 2.1e5);
  EXPECT_EQ(MakeScenario(c, c.experiments[1], run).settings.at("confining_pressure"), 5e5);
  EXPECT_EQ(
      MakeScenario(c, c.experiments[0], run).model.parameters.count("tx02.confining_pressure"), 0U);
  EXPECT_EQ(c.experiments[0].settings.at("confining_pressure"), 2e5) << "the nominal value stands";
}

TEST(CalibratedSettings, WithoutAnExperimentAreOfAllThatHaveThem) {
  const Campaign c =
      ReadGood(WithLines("  confining_pressure: {prior: uniform, min: 0.1 MPa, max: 1 MPa}\n"
                         "  packing.porosity: {prior: uniform, min: 0.38, max: 0.42}\n"));
  EXPECT_THAT(c.parameters[4].setting->experiments, ElementsAre("tx02", "tx05"));
  EXPECT_THAT(c.parameters[5].setting->experiments, ElementsAre("tx05"))
      << "the packing of tx02 is a file";
  const RunOf run = RunWith({3e5, 0.39}, 2);
  for (const Experiment& experiment : c.experiments) {
    EXPECT_EQ(MakeScenario(c, experiment, run).settings.at("confining_pressure"), 3e5);
  }
  EXPECT_FALSE(ChangedRecipe(c, c.experiments[0], run).has_value());
  const auto recipe = ChangedRecipe(c, c.experiments[1], run);
  ASSERT_TRUE(recipe.has_value());
  EXPECT_EQ(recipe->porosity, 0.39);
  EXPECT_EQ(recipe->seed, std::get<dem::PackingRecipe>(c.experiments[1].specimens[2]).seed);
}

TEST(CalibratedSettings, LeftOutInTheExperimentHaveTheMiddleOfTheirPriorAsNominalValue) {
  std::string yaml = WithLines(
      "  tx02.confining_pressure: {prior: uniform, min: 0.15 MPa, max: 0.25 MPa}\n"
      "  packing.void_ratio: {prior: uniform, min: 0.6, max: 0.7}\n"
      "  packing.mean_radius: {prior: uniform, min: 1 mm, max: 2 mm}\n"
      "  tx05.consolidation.friction_coefficient: {prior: uniform, min: 0.1, max: 0.3}\n"
      "  staging.rate: {prior: log_uniform, min: 0.01 1/s, max: 1 1/s}\n");
  yaml = Replaced(yaml, "    confining_pressure: 0.2 MPa\n", "");
  yaml =
      Replaced(yaml, "void_ratio: 0.68, radii: {mean: 1 mm, spread: 0.2}", "radii: {spread: 0.2}");
  const Campaign c = ReadGood(yaml);
  EXPECT_NEAR(c.experiments[0].settings.at("confining_pressure"), 2e5, 1e-6);
  const auto& recipe = std::get<dem::PackingRecipe>(c.experiments[1].specimens[0]);
  EXPECT_NEAR(recipe.porosity, 0.65 / 1.65, 1e-12);
  EXPECT_NEAR(recipe.mean_radius, 1.5e-3, 1e-12);
  EXPECT_EQ(recipe.radius_spread, 0.2);
  EXPECT_FALSE(c.experiments[0].consolidation.friction_coefficient.has_value());
  EXPECT_NEAR(*c.experiments[1].consolidation.friction_coefficient, 0.2, 1e-12);
  EXPECT_NEAR(*c.experiments[0].staging.rate, 0.1, 1e-12);
}

TEST(CalibratedSettings, OfAnOptionalKindAreOfThoseThatStateThem) {
  const std::string friction =
      "  consolidation.friction_coefficient: {prior: uniform, min: 0, max: 0.3}\n";
  const Campaign all = ReadGood(WithLines(friction));
  EXPECT_THAT(all.parameters[4].setting->experiments, ElementsAre("tx02", "tx05"));
  const Campaign one = ReadGood(Replaced(WithLines(friction), "    role: validate\n",
                                         "    role: validate\n    consolidation: "
                                         "{friction_coefficient: 0.1}\n"));
  EXPECT_THAT(one.parameters[4].setting->experiments, ElementsAre("tx05"));
}

TEST(CalibratedSettings, MayBeTiedAndTiedTo) {
  const Campaign c =
      ReadGood(WithLines(
          kPressure + "  tx05.confining_pressure: {equal_to: \"2.5 * tx02.confining_pressure\"}\n"
                      "  density: {equal_to: \"2650 * (1 + 0.1 * (young_modulus > 2e9))\"}\n"));
  EXPECT_EQ(c.tied.size(), 2U);
  const dem::Scenario run = MakeScenario(c, c.experiments[1], RunWith({2.1e5}));
  EXPECT_DOUBLE_EQ(run.settings.at("confining_pressure"), 5.25e5);
  EXPECT_EQ(run.model.density, 2650);
  EXPECT_EQ(run.model.parameters.count("density"), 0U);
}

const std::string kSilo = R"(name: silo
model:
  contact: hertz_mindlin
  fixed: {young_modulus: 1e7, poisson_ratio: 0.25}
parameters:
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.9}
  opening: {prior: uniform, min: 20 mm, max: 40 mm}
experiments:
  - name: outlet
    test: silo_discharge
    silo_width: 10 cm
    packing: {generate: {particles: 200, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}
    data: {file: silo.csv, units: {opening: mm}}
    control: opening
    observables: {mass_flow_rate: {noise: {relative: 0.05}}}
inference: {samples: 10}
)";

TEST(CalibratedSettings, MayBeAControlWithOneReading) {
  const std::string head = "opening,mass_flow_rate\n";
  const auto read = [&](const std::string& rows) {
    return ReadCampaign(methods::All(), kSilo, "c.yaml", ReaderOf({{"silo.csv", head + rows}}));
  };
  const ReadOutcome one = read("30,0.5\n");
  for (const Problem& problem : one.problems) ADD_FAILURE() << ToString(problem);
  const dem::Scenario run =
      MakeScenario(one.campaign, one.campaign.experiments[0], {{0.5, 0.025}, 0});
  ASSERT_EQ(run.path.size(), 1U);
  EXPECT_EQ(run.path[0].target, 0.025);
  EXPECT_EQ(run.settings.count("opening"), 0U);
  const ReadOutcome two = read("30,0.5\n20,0.2\n");
  ASSERT_EQ(two.problems.size(), 1U);
  EXPECT_THAT(two.problems[0].message,
              HasSubstr("is the control of outlet, which has 2 readings; a control is calibrated "
                        "where there is one"));
}

TEST(CalibratedSettings, ThatATestCannotHaveAtAnEndOfTheirPriorAreRefused) {
  std::string yaml = Replaced(kSilo, "opening: {prior: uniform, min: 20 mm, max: 40 mm}",
                              "silo_width: {prior: uniform, min: 1 mm, max: 10 cm}");
  yaml = Replaced(yaml, "    silo_width: 10 cm\n", "");
  const ReadOutcome outcome = ReadCampaign(
      methods::All(), yaml, "c.yaml", ReaderOf({{"silo.csv", "opening,mass_flow_rate\n30,0.5\n"}}));
  ASSERT_EQ(outcome.problems.size(), 1U);
  EXPECT_THAT(ToString(outcome.problems[0]),
              HasSubstr("parameters.silo_width: makes outlet impossible at 0.001 m, an end of its "
                        "prior: "));
}

// It is cut off at the admissible range, whose end no run comes to.
TEST(CalibratedSettings, MayHaveANormalPriorWithoutBounds) {
  for (const char* prior : {"{prior: normal, mean: 0.2 MPa, sd: 0.02 MPa}",
                            "{prior: log_normal, mean: 0.2 MPa, sd: 0.1}"}) {
    const Campaign c =
        ReadGood(WithLines(absl::StrCat("  tx02.confining_pressure: ", prior, "\n")));
    EXPECT_GT(c.parameters.back().prior.Quantile(0.001), 0.1e6) << prior;
  }
}

TEST(CalibratedSettings, OfWhatADerivedCampaignHasNotChangeNothing) {
  const std::string yaml =
      WithLines("  tx05.confining_pressure: {prior: uniform, min: 0.4 MPa, max: 0.6 MPa}\n");
  const auto derived = Derive(methods::All(), yaml,
                              {.name = "sand + cell",
                               .lineage = {.parent = "c1", .purpose = "extension"},
                               .held_out = false});
  ASSERT_TRUE(derived.ok());
  const Campaign c = ReadGood(*derived);
  ASSERT_EQ(c.experiments.size(), 1U);
  ASSERT_EQ(c.parameters.size(), 5U);
  EXPECT_EQ(c.parameters[4].unit, "Pa");
  EXPECT_THAT(c.parameters[4].setting->experiments, IsEmpty());
  const dem::Scenario run = MakeScenario(c, c.experiments[0], RunWith({5e5}));
  EXPECT_EQ(run.settings.at("confining_pressure"), 2e5);
  EXPECT_EQ(run.model.parameters.count("tx05.confining_pressure"), 0U);
}

TEST(CalibratedSettings, OfAPredictedTestStayAsStated) {
  const std::string yaml = WithLines(
      "  confining_pressure: {prior: uniform, min: 0.1 MPa, max: 1 MPa}\n"
      "  packing.void_ratio: {prior: uniform, min: 0.6, max: 0.7}\n");
  const Campaign parent = ReadGood(yaml);
  const auto parse = ParseYaml(
      "name: p\ntest: triaxial_drained\nconfining_pressure: 0.3 MPa\npacking: {generate: "
      "{particles: 100, porosity: 0.4, radii: {mean: 1 mm}}}\ndata: {file: validation.csv, strain: "
      "logarithmic}\ncontrol: axial_strain\nobservables: {q_over_p: {noise: {relative: 0.05}}}\n");
  YamlNode experiment = *parse.root;
  EXPECT_THAT(StatedBeside(experiment, parent),
              ::testing::UnorderedElementsAre("confining_pressure", "packing.porosity",
                                              "packing.void_ratio"));
  YamlAt(experiment, "as_stated") =
      YamlList({YamlScalar("confining_pressure"), YamlScalar("packing.void_ratio")});
  const auto derived = Derive(methods::All(), yaml,
                              {.name = "prediction",
                               .lineage = {.parent = "c1", .purpose = "prediction"},
                               .experiments = {experiment},
                               .rows = {{.like = 0,
                                         .values = {{"young_modulus", 1e9},
                                                    {"friction_angle", 0.5},
                                                    {"rolling_resistance.stiffness", 0.3},
                                                    {"rolling_resistance.friction", 0.4},
                                                    {"confining_pressure", 5e5},
                                                    {"packing.void_ratio", 0.65}}}}});
  ASSERT_TRUE(derived.ok());
  const Campaign c = ReadGood(*derived);
  const RunOf run = RunWith({5e5, 0.65});
  EXPECT_EQ(MakeScenario(c, c.experiments[0], run).settings.at("confining_pressure"), 3e5);
  EXPECT_FALSE(ChangedRecipe(c, c.experiments[0], run).has_value());
  EXPECT_THAT(SettingsOfAll(parent), ElementsAre("confining_pressure", "packing.void_ratio"));
}

TEST(CalibratedSettings, AreListed) {
  const std::string yaml = testing::GoodYaml();
  const auto all = CalibratableIn(yaml, ReadGood(yaml));
  const auto of = [&all](const std::string& name) {
    for (const Calibratable& one : all) {
      if (one.name == name) return one.experiments;
    }
    return std::vector<std::string>{"none of this name"};
  };
  EXPECT_THAT(of("young_modulus"), IsEmpty());
  EXPECT_THAT(of("rolling_resistance.friction"), IsEmpty());
  EXPECT_THAT(of("confining_pressure"), ElementsAre("tx02", "tx05"));
  EXPECT_THAT(of("packing.porosity"), ElementsAre("tx05"));
  EXPECT_THAT(SettingNames(OutlinesOf(YamlFind(*ParseYaml(yaml).root, "experiments"))),
              Contains("tx05.packing.mean_radius"));
}

struct WrongSetting {
  const char* name;
  const char* lines;
  const char* from;  // of the rest of the file
  const char* to;
  const char* expected;
};

class WrongSettings : public ::testing::TestWithParam<WrongSetting> {};

TEST_P(WrongSettings, AreRefusedInOneSentence) {
  const WrongSetting& wrong = GetParam();
  std::string yaml = WithLines(wrong.lines);
  if (*wrong.from != '\0') yaml = Replaced(yaml, wrong.from, wrong.to);
  const std::string problems = ProblemsOf(yaml);
  EXPECT_THAT(problems, HasSubstr(wrong.expected));
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
}

INSTANTIATE_TEST_SUITE_P(
    All, WrongSettings,
    ::testing::Values(
        WrongSetting{"Unknown", "  tx02.confining_presure: {prior: uniform, min: 1, max: 2}\n", "",
                     "",
                     "parameters.tx02.confining_presure: is not a parameter of hertz_mindlin with "
                     "rolling_resistance nor a setting of an experiment; did you mean "
                     "'tx02.confining_pressure'?"},
        WrongSetting{"OfAPackingFile",
                     "  tx02.packing.porosity: {prior: uniform, min: 0.3, max: 0.4}\n", "", "",
                     "parameters.tx02.packing.porosity: is not a parameter of hertz_mindlin with "
                     "rolling_resistance nor a setting of an experiment; did you mean "
                     "'tx05.packing.porosity'?"},
        WrongSetting{"Impossible",
                     "  confining_pressure: {prior: uniform, min: -1 kPa, max: 1 MPa}\n", "", "",
                     "parameters.confining_pressure: the prior from -1000 to 1e+06 leaves what is "
                     "admissible: between 0 (excluded) and 1e+10 Pa"},
        WrongSetting{"UnitOfAnotherKind",
                     "  confining_pressure: {prior: uniform, min: 1 deg, max: 1 MPa}\n", "", "",
                     "parameters.confining_pressure.min: deg is an angle (deg, rad), expected a "
                     "pressure (Pa, kPa, MPa, GPa)"},
        WrongSetting{"Twice",
                     "  confining_pressure: {prior: uniform, min: 0.1 MPa, max: 1 MPa}\n"
                     "  tx05.confining_pressure: {prior: uniform, min: 0.1 MPa, max: 1 MPa}\n",
                     "", "",
                     "parameters.tx05.confining_pressure: sets confining_pressure of tx05, as "
                     "confining_pressure does; keep one of them"},
        WrongSetting{"PorosityTwice",
                     "  packing.porosity: {prior: uniform, min: 0.38, max: 0.42}\n"
                     "  packing.void_ratio: {prior: uniform, min: 0.6, max: 0.7}\n",
                     "", "",
                     "parameters.packing.void_ratio: sets packing.void_ratio of tx05, as "
                     "packing.porosity does; keep one of them"},
        WrongSetting{"ExperimentCalledAsAGroup", "", "name: tx02", "name: packing",
                     "experiments[1].name: 'packing' is what a group of settings is called, by "
                     "which parameters are named; call the experiment another"},
        WrongSetting{"ExperimentCalledAsAnEffect", "", "name: tx02", "name: adhesion_jkr",
                     "experiments[1].name: 'adhesion_jkr' is what an effect is called, by which "
                     "parameters are named; call the experiment another"},
        WrongSetting{"TwoMeanings",
                     "  tx02.density: {prior: uniform, min: 2000 kg/m^3, max: 3000 kg/m^3}\n",
                     "  fixed: {poisson_ratio: 0.2}\n",
                     "  fixed: {poisson_ratio: 0.2}\n  materials: {tx02: {poisson_ratio: 0.3}}\n",
                     "parameters.tx02.density: has two meanings, the parameter of the model and "
                     "the setting density of tx02; the setting of one is called "
                     "EXPERIMENT.tx02.density"},
        WrongSetting{"AsStatedOfNothing", "", "    role: calibrate\n",
                     "    role: calibrate\n    as_stated: [opening]\n",
                     "experiments[1].as_stated: 'opening' is no setting of this experiment; "}),
    [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace calib::campaign
