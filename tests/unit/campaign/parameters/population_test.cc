// Parameters with a value for each experiment or batch: read, refused, and what they make of a run.
#include "server/campaign/model/population.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/campaign/checks/warning.h"
#include "server/campaign/file/derive.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using testing::GoodFiles;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProblemsOf;
using testing::ReaderOf;
using testing::Spoiled;

constexpr double kDegree = 0.017453292519943295;

// tx02 is fitted, tx05 is held out.
std::string WithAngle(const std::string& further) {
  return Spoiled("max: 45 deg}", "max: 45 deg, " + further + "}");
}
const std::string kPer = "per: experiment, spread: {prior: half_normal, sd: 2 deg}";

// Four experiments of a program, of the batches A, A, B and C; that of C is held out.
std::string ProgramYaml(const std::string& stiffness) {
  std::string yaml = absl::StrCat("name: springs\nmodel: {command: [python3, spring.py], files: ",
                                  "[spring.py]}\nparameters:\n  stiffness: ", stiffness,
                                  "\n  offset: {prior: normal, mean: 0, sd: 1}\nexperiments:\n");
  for (const char* name : {"a1:A", "a2:A", "b1:B", "c1:C"}) {
    const std::string text = name;
    absl::StrAppend(&yaml, "  - name: ", text.substr(0, 2), "\n    batch: ", text.substr(3),
                    "\n    data: {file: a.csv}\n    control: pull\n    observables: {force: ",
                    "{noise: {absolute: 0.1}}}\n", text == "c1:C" ? "    role: validate\n" : "");
  }
  return yaml + "inference: {samples: 10}\n";
}
const std::string kPerBatch =
    "{prior: uniform, min: 1, max: 9, per: batch, spread: {prior: half_normal, sd: 0.5}}";

std::map<std::string, std::string> ProgramFiles() {
  return {
      {"spring.py/", "- \n"}, {"spring.py", "pass\n"}, {"a.csv", "pull,force\n0,0\n1,2\n2,4\n"}};
}

ReadOutcome Read(const std::string& yaml, const std::map<std::string, std::string>& files) {
  return ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files));
}
Campaign Good(const ReadOutcome& outcome) {
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  return outcome.campaign;
}
Campaign GoodSand(const std::string& yaml) { return Good(Read(yaml, GoodFiles())); }
Campaign GoodSprings(const std::string& yaml) { return Good(Read(yaml, ProgramFiles())); }

std::vector<std::string> NamesIn(const Campaign& campaign) {
  std::vector<std::string> names;
  for (const CalibratedParameter& parameter : campaign.parameters) names.push_back(parameter.name);
  return names;
}

double StiffnessOf(const Campaign& campaign, int experiment, const std::vector<double>& values) {
  const v1::ProgramRun run = messages::ProgramRunOf(campaign, experiment, {.values = values});
  EXPECT_EQ(run.parameters_size(), 2) << "no spread and no score is the program's";
  EXPECT_EQ(run.units_size(), 2);
  return run.parameters().at("stiffness");
}

TEST(Population, IsACommonValueASpreadAndAScoreForEachLabel) {
  const Campaign c = GoodSand(WithAngle(kPer));
  EXPECT_THAT(NamesIn(c),
              ElementsAre("young_modulus", "friction_angle", "friction_angle.spread",
                          "friction_angle@tx02.score", "friction_angle@tx05.score",
                          "rolling_resistance.stiffness", "rolling_resistance.friction"));
  EXPECT_EQ(c.parameters[2].unit, "rad");
  EXPECT_EQ(c.parameters[2].prior.kind, inference::PriorKind::kNormal);
  EXPECT_EQ(c.parameters[2].prior.min, 0);
  EXPECT_EQ(c.parameters[2].prior.mean, 0);
  EXPECT_DOUBLE_EQ(c.parameters[2].prior.sd, 2 * kDegree);
  EXPECT_FALSE(c.parameters[2].nuisance);
  EXPECT_EQ(c.parameters[3].prior.kind, inference::PriorKind::kNormal);
  EXPECT_EQ(c.parameters[3].prior.sd, 1);
  EXPECT_TRUE(std::isinf(c.parameters[3].prior.max));
  EXPECT_TRUE(c.parameters[3].nuisance);
  ASSERT_EQ(c.populations.size(), 1U);
  EXPECT_THAT(c.populations[0].labels, ElementsAre("tx02", "tx05"));
  EXPECT_DOUBLE_EQ(c.populations[0].max, 45 * kDegree);
}

TEST(Population, ARunHasTheValueOfItsExperiment) {
  const Campaign c = GoodSand(WithAngle(kPer));
  const RunOf run{.values = {1e9, 0.5, 0.02, 1.5, -1, 0.25, 0.5}};
  const auto of = [&](std::size_t e) { return MakeScenario(c, c.experiments[e], run); };
  EXPECT_DOUBLE_EQ(of(0).model.parameters.at("friction_angle"), 0.53);
  EXPECT_DOUBLE_EQ(of(1).model.parameters.at("friction_angle"), 0.48);
  EXPECT_EQ(of(0).model.parameters.size(), 5U) << "what the model has, the fixed one included";
}

TEST(Population, ASettingToo) {
  const Campaign c = GoodSand(Spoiled(
      "experiments:\n",
      "  confining_pressure: {prior: uniform, min: 0.1 MPa, max: 0.9 MPa, per: experiment, spread: "
      "{prior: half_normal, sd: 10 kPa}}\nexperiments:\n"));
  const RunOf run{.values = {1e9, 0.5, 0.25, 0.5, 3e5, 1e4, 2, -1}};
  const auto pressure = [&](std::size_t e) {
    return MakeScenario(c, c.experiments[e], run).settings.at("confining_pressure");
  };
  EXPECT_EQ(pressure(0), 3.2e5);
  EXPECT_EQ(pressure(1), 2.9e5);
}

TEST(Population, WhatIsTiedFollowsTheValueOfTheExperiment) {
  std::string yaml = WithAngle(kPer);
  yaml = absl::StrReplaceAll(
      yaml, {{"rolling_resistance.friction: {prior: uniform, min: 0, max: 1}",
              "rolling_resistance.friction: {equal_to: \"0.5 * friction_angle\"}"}});
  const Campaign c = GoodSand(yaml);
  const RunOf run{.values = {1e9, 0.5, 0.02, 1.5, -1, 0.25}};
  EXPECT_DOUBLE_EQ(
      MakeScenario(c, c.experiments[0], run).model.parameters.at("rolling_resistance.friction"),
      0.265);
}

TEST(Population, AProgramIsToldTheValueOfItsBatch) {
  const Campaign c = GoodSprings(ProgramYaml(kPerBatch));
  EXPECT_THAT(NamesIn(c), ElementsAre("stiffness", "stiffness.spread", "stiffness@A.score",
                                      "stiffness@B.score", "stiffness@C.score", "offset"));
  const std::vector<double> values = {5, 0.5, 1, -2, 0, 0.125};
  EXPECT_EQ(StiffnessOf(c, 0, values), 5.5);
  EXPECT_EQ(StiffnessOf(c, 1, values), 5.5);
  EXPECT_EQ(StiffnessOf(c, 2, values), 4);
  EXPECT_EQ(StiffnessOf(c, 3, values), 5);
}

// Runs are known by what the program is told, not by how that came about.
TEST(Population, ARunIsKnownByTheValueAlone) {
  const Campaign c = GoodSprings(ProgramYaml(kPerBatch));
  const auto digest = [&c](int experiment, std::vector<double> values) {
    v1::Lease lease = messages::LeaseOf(c, experiment, {.values = std::move(values)});
    lease.mutable_program()->clear_experiment();
    return messages::RunDigest(lease);
  };
  const std::vector<double> values = {5, 0.5, 1, -2, 0, 0.125};
  EXPECT_EQ(digest(0, values), digest(1, values)) << "of one batch";
  EXPECT_NE(digest(0, values), digest(2, values)) << "of two";
  EXPECT_EQ(digest(0, values), digest(0, {5, 0.5, 1, 3, 1, 0.125})) << "others' scores";
  EXPECT_EQ(digest(0, values), digest(0, {5.25, 0.25, 1, 0, 0, 0.125})) << "the same value";
}

TEST(Population, ValuesOutsideTheBoundsHaveNoDensity) {
  const inference::JointPrior prior = Priors(GoodSprings(ProgramYaml(kPerBatch)));
  const auto at = [&prior](double common, double spread, double a, double c) {
    Eigen::VectorXd x(6);
    x << common, spread, a, 0, c, 0;
    return prior.LogDensity(x);
  };
  EXPECT_TRUE(std::isfinite(at(8.5, 0.5, 0.9, 0)));
  EXPECT_TRUE(std::isinf(at(8.5, 0.5, 1.1, 0)));
  EXPECT_TRUE(std::isinf(at(1.5, 0.5, 0, -1.1))) << "of a label that is only held out too";
  EXPECT_LT(prior.log_mass(), -0.05);
  EXPECT_GT(prior.log_mass(), -0.3);
}

TEST(Population, WithoutBoundsThePriorIsIndependent) {
  const Campaign c = GoodSprings(ProgramYaml(
      "{prior: normal, mean: 5, sd: 1, per: batch, spread: {prior: half_normal, sd: 0.5}}"));
  EXPECT_FALSE(Priors(c).is_constrained());
}

struct WrongPopulation {
  const char* name;
  std::string further;  // beside the prior of friction_angle
  const char* expected;
};
void PrintTo(const WrongPopulation& wrong, std::ostream* out) { *out << wrong.name; }

class WrongPopulations : public ::testing::TestWithParam<WrongPopulation> {};
TEST_P(WrongPopulations, AreRefusedInOneLine) {
  const std::string problems = ProblemsOf(WithAngle(GetParam().further));
  EXPECT_THAT(problems, HasSubstr(GetParam().expected));
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
}
INSTANTIATE_TEST_SUITE_P(
    Population, WrongPopulations,
    ::testing::Values(
        WrongPopulation{"SpreadAlone", "spread: {prior: half_normal, sd: 2 deg}",
                        "parameters.friction_angle.spread: belongs to per: experiment or per: "
                        "batch; without it there is one value"},
        WrongPopulation{"PerAlone", "per: experiment",
                        "parameters.friction_angle.per: needs spread, the prior of how far the "
                        "values lie apart"},
        WrongPopulation{"LabelsAlone", "labels: [tx02]", "friction_angle.labels: belongs to per"},
        WrongPopulation{"OtherPrior", "per: experiment, spread: {prior: normal, sd: 2 deg}",
                        "half_normal"},
        WrongPopulation{"SpreadOfNothing", "per: experiment, spread: {prior: half_normal, sd: 0}",
                        "greater than 0"},
        WrongPopulation{"OtherUnit", "per: experiment, spread: {prior: half_normal, sd: 2 Pa}",
                        "rad"},
        WrongPopulation{"PerGrain", "per: grain, spread: {prior: half_normal, sd: 2 deg}",
                        "allowed: experiment, batch"}),
    [](const auto& one) { return one.param.name; });

TEST(Population, ABatchIsMissing) {
  const std::string problems =
      ProblemsOf(WithAngle("per: batch, spread: {prior: half_normal, sd: 2 deg}"));
  EXPECT_THAT(problems, HasSubstr("experiments[1].batch: is missing; friction_angle has a value "
                                  "for each batch"));
  EXPECT_THAT(problems, HasSubstr("experiments[2].batch"));
}

TEST(Population, ANumberOfOneExperimentHasOneValue) {
  EXPECT_THAT(ProblemsOf(Spoiled("experiments:\n",
                                 "  tx02.confining_pressure: {prior: normal, mean: 0.2 MPa, sd: 1 "
                                 "kPa, per: experiment, spread: {prior: half_normal, sd: 1 kPa}}\n"
                                 "experiments:\n")),
              HasSubstr("parameters.tx02.confining_pressure: is a number of one experiment"));
}

TEST(Population, IsNeitherTiedNorFixedNorHeld) {
  EXPECT_THAT(ProblemsOf(Spoiled("{prior: uniform, min: 10 deg, max: 45 deg}",
                                 "{equal_to: rolling_resistance.stiffness, per: experiment}")),
              HasSubstr("parameters.friction_angle.per: has no place beside equal_to"));
  std::string fixed = WithAngle(kPer);
  fixed = absl::StrReplaceAll(
      fixed, {{"{poisson_ratio: 0.2}", "{poisson_ratio: 0.2, friction_angle: 30 deg}"}});
  EXPECT_THAT(ProblemsOf(fixed), HasSubstr("friction_angle is both calibrated and fixed"));
  std::string held = WithAngle(kPer);
  held = absl::StrReplaceAll(held, {{"max_iterations: 3",
                                     "max_iterations: 3, freeze: {1: "
                                     "[young_modulus]}"}});
  EXPECT_THAT(ProblemsOf(held), HasSubstr("freeze: does not go with parameters per experiment or "
                                          "batch (friction_angle)"));
}

TEST(Population, NamesMeanOneThing) {
  const auto problems = [](const std::string& yaml) {
    std::string lines;
    for (const Problem& problem : Read(yaml, ProgramFiles()).problems) lines += ToString(problem);
    return lines;
  };
  EXPECT_THAT(
      problems(absl::StrReplaceAll(ProgramYaml(kPerBatch), {{"offset:", "stiffness.spread:"}})),
      HasSubstr("stiffness: has a spread called stiffness.spread, as another parameter is"));
  EXPECT_THAT(
      problems(absl::StrReplaceAll(ProgramYaml(kPerBatch), {{"batch: B", "batch: B.score"}})),
      HasSubstr("experiments[3].batch: 'B.score' ends in .score"));
  EXPECT_THAT(problems(absl::StrReplaceAll(ProgramYaml(kPerBatch), {{"batch: B", "batch: B 2"}})),
              HasSubstr("'B 2' is not a short word"));
}

TEST(Population, RunsMadeElsewhereHaveOneValue) {
  const std::string yaml =
      "name: t\nmodel: {precomputed: {parameters: p.csv, states: s.csv}}\nparameters:\n"
      "  k: {prior: uniform, min: 0, max: 1, per: experiment, spread: {prior: half_normal, sd: "
      "0.1}}\nexperiments:\n  - {name: a, data: {file: a.csv}, control: pull, observables: {force: "
      "{noise: {absolute: 0.1}}}}\ninference: {method: sqmc}\n";
  const std::string problems =
      ProblemsOf(yaml, {{"p.csv", "sample,k\n0,0.1\n1,0.5\n2,0.7\n"},
                        {"s.csv", "sample,step,force\n0,0,1\n1,0,1\n2,0,2\n"},
                        {"a.csv", "pull,force\n0,1\n"}});
  EXPECT_THAT(problems, HasSubstr("parameters.k: cannot differ between experiments: runs made "
                                  "elsewhere have one value of each parameter"));
}

std::vector<std::string> LabelWarnings(const ReadOutcome& outcome) {
  std::vector<std::string> found;
  for (const Warning& warning : outcome.warnings) {
    if (warning.kind == WarningKind::kLabels) found.push_back(Sentence(warning));
  }
  return found;
}

TEST(Population, OfOneFittedLabelIsWarnedOf) {
  EXPECT_THAT(LabelWarnings(Read(WithAngle(kPer), GoodFiles())),
              ElementsAre(HasSubstr("one value among the fitted experiments, of tx02")));
  EXPECT_THAT(LabelWarnings(Read(ProgramYaml(kPerBatch), ProgramFiles())), IsEmpty());
}

TEST(Population, ABatchThatNobodyReadsIsWarnedOf) {
  EXPECT_THAT(LabelWarnings(
                  Read(Spoiled("  - name: tx02\n", "  - name: tx02\n    batch: A\n"), GoodFiles())),
              ElementsAre(HasSubstr("batch: A is read by no parameter")));
}

// --- what is derived -----------------------------------------------------------------------------

std::string Derived(const Derivation& derivation) {
  const auto text = Derive(methods::All(), ProgramYaml(kPerBatch), derivation);
  EXPECT_TRUE(text.ok()) << text.status();
  return text.value_or("");
}

YamlNode TestOf(const std::string& name, const std::string& batch) {
  return *ParseYaml(absl::StrCat("name: ", name, "\n",
                                 batch.empty() ? "" : "batch: " + batch + "\n",
                                 "data: {file: a.csv}\ncontrol: pull\nobservables: [force]\n"))
              .root;
}

Derivation::Row RowOf(std::map<std::string, double> values) {
  return {.like = 0, .values = std::move(values)};
}

TEST(Population, KeepsItsLabelsWithoutTheHeldOut) {
  const Campaign c = GoodSprings(Derived(
      {.name = "design", .lineage = {.parent = "c1", .purpose = "extension"}, .held_out = false}));
  EXPECT_EQ(c.experiments.size(), 3U);
  EXPECT_THAT(c.populations[0].labels, ElementsAre("A", "B", "C"));
  EXPECT_THAT(NamesIn(c), Contains("stiffness@C.score"));
  const std::string again = *Derive(
      methods::All(), Derived({.name = "one", .lineage = {.parent = "c1", .purpose = "extension"}}),
      {.name = "two", .lineage = {.parent = "c2", .purpose = "extension"}});
  EXPECT_EQ(NamesIn(GoodSprings(again)), NamesIn(c));
}

TEST(Population, ATestOfAKnownBatchHasItsValue) {
  const Campaign c = GoodSprings(Derived({.name = "prediction",
                                          .lineage = {.parent = "c1", .purpose = "prediction"},
                                          .experiments = {TestOf("p1", "B")},
                                          .new_labels = true,
                                          .rows = {RowOf({{"stiffness", 5},
                                                          {"stiffness.spread", 0.5},
                                                          {"stiffness@A.score", 1},
                                                          {"stiffness@B.score", -2},
                                                          {"stiffness@C.score", 0},
                                                          {"offset", 0}})}}));
  EXPECT_THAT(c.populations[0].labels, ElementsAre("A", "B", "C"));
  const Eigen::VectorXd row = c.table->parameters.row(0);
  EXPECT_EQ(StiffnessOf(c, 0, {row.begin(), row.end()}), 4);
}

TEST(Population, ATestOfAnUnknownBatchHasAScoreOfItsOwn) {
  for (const bool named : {true, false}) {
    const std::string label = named ? "D" : "unseen";
    const Campaign c =
        GoodSprings(Derived({.name = "prediction",
                             .lineage = {.parent = "c1", .purpose = "prediction"},
                             .experiments = {TestOf("p1", named ? "D" : ""), TestOf("p2", "A")},
                             .new_labels = true,
                             .rows = {RowOf({{"stiffness", 5},
                                             {"stiffness.spread", 0.5},
                                             {"stiffness@A.score", 1},
                                             {"stiffness@B.score", -2},
                                             {"stiffness@C.score", 0},
                                             {ScoreName("stiffness", label), 3},
                                             {"offset", 0}})}}));
    EXPECT_THAT(c.populations[0].labels, ElementsAre("A", "B", "C", label));
    const Eigen::VectorXd row = c.table->parameters.row(0);
    EXPECT_EQ(StiffnessOf(c, 0, {row.begin(), row.end()}), 6.5);
    EXPECT_EQ(StiffnessOf(c, 1, {row.begin(), row.end()}), 5.5);
  }
}

TEST(Population, AnExperimentOfAnotherLabelHasTheCommonValue) {
  const Campaign c = GoodSprings(Derived({.name = "next",
                                          .lineage = {.parent = "c1", .purpose = "design"},
                                          .experiments = {TestOf("next", "D")},
                                          .rows = {RowOf({{"stiffness", 5}, {"offset", 0}})}}));
  EXPECT_EQ(StiffnessOf(c, 0, {5, 0.5, 1, 1, 1, 0}), 5);
  EXPECT_EQ(c.table->parameters.row(0).size(), 6) << "spread and scores are 0 where left out";
}

// --- numbers -------------------------------------------------------------------------------------

TEST(Population, AnUnseenScoreIsStandardNormalWithinTheBounds) {
  const Population free{.name = "k"};
  const Population bounded{.name = "k", .min = 4, .max = 6};
  constexpr int kDraws = 4000;
  double sum = 0, squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    inference::PhiloxStream stream({.seed = 3, .sample = static_cast<std::uint64_t>(i)});
    const double score = DrawScore(free, 5, 0.5, stream);
    sum += score;
    squares += score * score;
    const double value = 5.5 + 0.5 * DrawScore(bounded, 5.5, 0.5, stream);
    ASSERT_TRUE(4 <= value && value <= 6) << value;
  }
  EXPECT_NEAR(sum / kDraws, 0, 0.06);  // four standard errors
  EXPECT_NEAR(squares / kDraws, 1, 0.09);
}

TEST(Population, CountsAsItsFittedLabels) {
  EXPECT_EQ(FreeParameters(GoodSprings(ProgramYaml(kPerBatch))), 3);  // A, B and the offset
  EXPECT_EQ(FreeParameters(GoodSprings(ProgramYaml("{prior: uniform, min: 1, max: 9}"))), 2);
}

}  // namespace
}  // namespace calib::campaign
