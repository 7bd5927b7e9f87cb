// Designs as their file gives them, and what their values make of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dem/registry/catalog.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/model/race.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProblemsOf;

// Parameters of the good campaign: young_modulus, friction_angle, rolling_resistance.stiffness and
// .friction.
std::string DesignYaml(const std::string& parameters, const std::string& inference) {
  std::string yaml = testing::GoodYaml();
  const auto replace = [&yaml](const std::string& from, const std::string& to) {
    const std::size_t at = yaml.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    yaml.replace(at, from.size(), to);
  };
  replace("inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}",
          "inference: {method: design" + inference + "}");
  replace("early_stopping: {discard_at_most: 1e-3}\n", "");
  replace("budget: {model_evaluations: 400, core_hours: 12}\n", "");
  replace("experiments:\n", parameters + "experiments:\n");
  return yaml;
}

const std::string kCell =
    "  load_cell_error.gain: {prior: uniform, min: -0.3, max: 0.3}\n"
    "  load_cell_error.offset: {prior: uniform, min: -1 kPa, max: 1 kPa}\n";
const std::string kAdhesion =
    "  adhesion_jkr.work_of_adhesion: {prior: log_uniform, min: 1e-3, max: 1}\n"
    "  adhesion_dmt.work_of_adhesion: {prior: log_uniform, min: 1e-3, max: 1}\n";
const std::string kRow =
    "young_modulus: 1 GPa, friction_angle: 30 deg, rolling_resistance.stiffness: 0.1, "
    "rolling_resistance.friction: 0.1";

Campaign ReadDesign(const std::string& yaml) {
  EXPECT_EQ(ProblemsOf(yaml), "") << yaml;
  return ReadCampaign(methods::All(), yaml, "c.yaml", testing::ReaderOf(testing::GoodFiles()))
      .campaign;
}

TEST(Design, IsReadWithItsRaceAndItsFirstRows) {
  const Campaign c = ReadDesign(
      DesignYaml(kCell, ", race: [load_cell_error], rows: [{" + kRow +
                            ", load_cell_error.gain: 0, load_cell_error.offset: 0, like: 4}]"));
  EXPECT_EQ(c.method->name(), "design");
  EXPECT_THAT(c.race, ElementsAre("load_cell_error"));
  EXPECT_THAT(c.model.effects, ElementsAre("rolling_resistance"));
  EXPECT_EQ(c.samples, kMostRowsOfBatch);
  ASSERT_TRUE(c.table.has_value());
  EXPECT_EQ(c.table->parameters.rows(), 1);
  EXPECT_THAT(c.table->like, ElementsAre(4));
  EXPECT_FALSE(ReadDesign(DesignYaml("", "")).table.has_value())
      << "neither a race nor rows are needed";
}

TEST(Design, AnEffectIsInTheRunWhereOneOfItsStrengthsLeavesItsNull) {
  const Campaign c = ReadDesign(DesignYaml(kCell, ", race: [load_cell_error]"));
  const std::vector<double> null = {1e9, 0.5, 0.1, 0.1, 0, 0};
  EXPECT_THAT(ActiveEffects(c, null), IsEmpty());
  EXPECT_EQ(ModelOf(c, c.experiments[0], null).parameters.count("load_cell_error.gain"), 0U);
  EXPECT_EQ(ModelOf(c, c.experiments[0], null).effects, c.model.effects);
  const std::vector<double> gain = {1e9, 0.5, 0.1, 0.1, 1e-300, 0};
  EXPECT_THAT(ActiveEffects(c, gain), ElementsAre("load_cell_error"));
  EXPECT_EQ(ModelOf(c, c.experiments[0], gain).parameters.at("load_cell_error.offset"), 0);
  EXPECT_THAT(ModelOf(c, c.experiments[0], gain).effects,
              ElementsAre("rolling_resistance", "load_cell_error"));
  EXPECT_THAT(ActiveEffects(c, std::vector<double>{1e9, 0.5, 0, 0, 0, 5}),
              ElementsAre("load_cell_error"))
      << "an effect of the model itself is always in it";
}

TEST(Design, ARunHoldsValuesOfItsPriorsOrNulls) {
  const Campaign c = ReadDesign(DesignYaml(kAdhesion, ", race: [adhesion_jkr, adhesion_dmt]"));
  const auto why = [&c](double modulus, double jkr, double dmt) {
    return WhyNotRun(c, std::vector<double>{modulus, 0.5, 0.1, 0.1, jkr, dmt});
  };
  EXPECT_EQ(why(1e9, 0, 0), "") << "the null lies outside the prior";
  EXPECT_EQ(why(1e9, 0.1, 0), "");
  EXPECT_THAT(why(1e9, 1e-4, 0), HasSubstr("adhesion_jkr.work_of_adhesion = 0.0001"));
  EXPECT_THAT(why(1e12, 0, 0), HasSubstr("young_modulus = 1e+12 Pa lies outside its prior"));
  EXPECT_THAT(why(0, 0, 0), HasSubstr("young_modulus")) << "a base parameter has no null";
  EXPECT_THAT(why(1e9, 0.1, 0.1), HasSubstr("is another law of what adhesion_jkr stands for"));
  EXPECT_THAT(why(1e9, std::nan(""), 0), HasSubstr("not finite"));
  EXPECT_THAT(WhyNotRun(c, std::vector<double>{1e9}), HasSubstr("1 values"));
}

TEST(Design, ConstraintsHoldInEveryRow) {
  const std::string tied = DesignYaml(kCell, ", race: [load_cell_error]") +
                           "constraints: [rolling_resistance.friction <= 0.5]\n";
  const Campaign c = ReadDesign(tied);
  EXPECT_EQ(WhyNotRun(c, std::vector<double>{1e9, 0.5, 0.1, 0.4, 0, 0}), "");
  EXPECT_THAT(WhyNotRun(c, std::vector<double>{1e9, 0.5, 0.1, 0.6, 0, 0}),
              HasSubstr("constraints"));
}

TEST(Design, NumericsAreFactorsOnWhatATestIsWalkedWith) {
  const Campaign c = ReadDesign(DesignYaml(
      "  numerics.rate: default\n  numerics.step: default\n  numerics.damping: default\n", ""));
  const auto staging = [&c](double rate, double step, double damping) {
    return MakeScenario(c, c.experiments[0], {{1e9, 0.5, 0.1, 0.1, rate, step, damping}, 0})
        .staging;
  };
  EXPECT_FALSE(staging(1, 1, 1).rate || staging(1, 1, 1).step || staging(1, 1, 1).damping_loading);
  const double rate = *staging(2, 1, 1).rate;
  EXPECT_EQ(*staging(4, 1, 1).rate, 2 * rate);
  EXPECT_FALSE(staging(2, 1, 1).step || staging(2, 1, 1).damping_loading);
  EXPECT_EQ(*staging(1, 0.5, 1).step, 0.001);  // half the engine's 0.002
  EXPECT_EQ(*staging(1, 1, 2).damping_loading, 0.4);
  EXPECT_EQ(*staging(1, 1, 8).damping_loading, 0.2 / 8) << "1.6 would be none";
}

TEST(Design, RefusesWhatItCannotRun) {
  const auto problem = [](const std::string& parameters, const std::string& inference) {
    return ProblemsOf(DesignYaml(parameters, inference));
  };
  EXPECT_THAT(problem("", ", race: [load_cell]"), HasSubstr("'load_cell' is not an effect"));
  EXPECT_THAT(problem("", ", race: [rolling_resistance]"), HasSubstr("is in model.effects"));
  EXPECT_THAT(problem(kCell, ", race: [load_cell_error, load_cell_error]"), HasSubstr("twice"));
  EXPECT_THAT(problem("", ", race: [load_cell_error]"),
              HasSubstr("load_cell_error needs a strength among the parameters: "
                        "load_cell_error.gain or load_cell_error.offset"));
  EXPECT_THAT(problem(kCell, ""), HasSubstr("add load_cell_error to model.effects"));
  EXPECT_THAT(problem("", ", samples: 3"), HasSubstr("belongs to methods that choose"));
  EXPECT_THAT(problem("", ", first_proposal: {prior_share: 1}"), HasSubstr("first_proposal"));
  EXPECT_THAT(problem("  numerics.rate: {prior: uniform, min: 0, max: 2}\n", ""),
              HasSubstr("leaves what is admissible"));
  EXPECT_THAT(problem("  numerics.speed: default\n", ""), HasSubstr("numerics.speed"));
  EXPECT_THAT(problem("", ", rows: [{" + kRow + "}, {" + kRow + ", like: -1}]"),
              HasSubstr("rows[1].like"));
  EXPECT_THAT(problem(kAdhesion, ", race: [adhesion_jkr, adhesion_dmt], rows: [{" + kRow +
                                     ", adhesion_jkr.work_of_adhesion: 0.1, "
                                     "adhesion_dmt.work_of_adhesion: 0.1}]"),
              HasSubstr("rows[0]: adhesion_dmt is another law"));
  const std::string design = DesignYaml("", "");
  EXPECT_THAT(ProblemsOf(design + "early_stopping: {discard_at_most: 1e-3}\n"),
              HasSubstr("the runs of a design go to their ends"));
  EXPECT_EQ(ProblemsOf(design + "early_stopping: off\n"), "");
  EXPECT_THAT(ProblemsOf(design + "budget: {core_hours: 2}\n"), HasSubstr("a design runs what"));
  EXPECT_THAT(ProblemsOf(testing::Spoiled("max_iterations: 3}", "max_iterations: 3, race: []}")),
              HasSubstr("inference.race: belongs to method: design"));
  EXPECT_THAT(ProblemsOf(testing::Spoiled("max_iterations: 3}",
                                          "max_iterations: 3}\nlineage: {parent: c1}")),
              HasSubstr("lineage"));
}

TEST(Design, FollowsFromItsBase) {
  const auto text =
      Derive(methods::All(), testing::GoodYaml(),
             {.name = "sand: race",
              .lineage = {.parent = "c1", .purpose = "design"},
              .parameters = {{"load_cell_error.gain", {.kind = "uniform", .min = -0.3, .max = 0.3}},
                             {"numerics.rate", {.kind = "log_uniform", .min = 0.5, .max = 2}}},
              .held_out = false,
              .first_proposal = std::nullopt,
              .race = std::vector<std::string>{"load_cell_error"}});
  ASSERT_TRUE(text.ok()) << text.status();
  const Campaign c = ReadDesign(*text);
  EXPECT_EQ(c.method->name(), "design");
  EXPECT_EQ(c.experiments.size(), 1U);
  EXPECT_THAT(c.race, ElementsAre("load_cell_error"));
  EXPECT_FALSE(c.budget.model_evaluations || c.early_stopping);
  EXPECT_EQ(c.failure.pause_above, 1);
}

}  // namespace
}  // namespace calib::campaign
