#include "server/campaign/file/derive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(YamlText, ReadsBackToTheSameTree) {
  const std::string text =
      "a: {b: [1, 'x: y', \"q\\\"uote\", ''], c: null}\nd:\n  - e: 1e-3\n    f: [-1, .inf]\n";
  const auto once = ParseYaml(text);
  ASSERT_TRUE(once.root);
  const std::string written = ToYaml(*once.root);
  const auto again = ParseYaml(written);
  ASSERT_TRUE(again.root) << written;
  EXPECT_EQ(ToYaml(*again.root), written);
  EXPECT_EQ(again.root->entries[0].value.entries[0].value.items[2].scalar, "q\"uote");
  EXPECT_EQ(again.root->entries[1].value.items[0].entries[1].value.items[0].scalar, "-1");
}

TEST(Derive, JoinsAnEffectAndStartsWhereTheParentEnded) {
  const auto text = Derive(
      methods::All(),
      "name: a\nmodel: {contact: linear}\nparameters: {young_modulus: default}\n"
      "experiments:\n  - {name: x, staging: {rate: 0.2 1/s}}\n  - {name: z}\n"
      "  - {name: y, role: validate}\n",
      {.name = "a + rolling_resistance",
       .lineage = {.parent = "c1", .purpose = "extension"},
       .effects = {"rolling_resistance"},
       .parameters = {{"rolling_resistance.friction", {.kind = "uniform", .min = 0, .max = 1}}},
       .held_out = false,
       .samples = 12,
       .first_proposal = FirstProposal{.prior_share = 0.5,
                                       .places = {{"young_modulus", {.center = 1e9, .sd = 1e7}}}}});
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_EQ(
      *text,
      "name: a + rolling_resistance\n"
      "model: {contact: linear, effects: [rolling_resistance]}\n"
      "parameters: {young_modulus: default, rolling_resistance.friction: {prior: uniform, min: "
      "0, max: 1}}\n"
      "experiments: [{name: x, staging: {rate: 0.2 1/s}}, {name: z}]\n"
      "lineage: {parent: c1, purpose: extension}\n"
      "inference:\n"
      "  samples: 12\n"
      "  first_proposal: {prior_share: 0.5, young_modulus: {center: 1e+09, sd: 1e+07}}\n"
      "failure: {pause_above: 1}\n")
      << *text;
}

// Every documented way to calibrate, with what steers it.
class DerivedFrom : public ::testing::TestWithParam<const char*> {
 protected:
  static std::string Parent() {
    std::string yaml = testing::GoodYaml();
    const std::size_t at = yaml.find("\ninference:");
    EXPECT_NE(at, std::string::npos);
    yaml.replace(at, yaml.find('\n', at + 1) - at, std::string("\ninference: ") + GetParam());
    EXPECT_EQ(testing::ProblemsOf(yaml), "");
    return yaml;
  }
  static const inline std::map<std::string, dem::DefaultPrior> kNew = {
      {"twisting_resistance.friction", {.kind = "uniform", .min = 0, .max = 1}},
      {"twisting_resistance.stiffness_ratio", {.kind = "uniform", .min = 0.1, .max = 1}}};
};

TEST_P(DerivedFrom, AnExtensionIsCalibratedAsItsParent) {
  const std::string parent = Parent();
  const auto text = Derive(methods::All(), parent,
                           {.name = "extension",
                            .lineage = {.parent = "c1", .purpose = "extension"},
                            .effects = {"twisting_resistance"},
                            .parameters = kNew,
                            .first_proposal = FirstProposal{}});
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_EQ(testing::ProblemsOf(*text), "") << *text;
  const FileReader files = testing::ReaderOf(testing::GoodFiles());
  EXPECT_EQ(ReadCampaign(methods::All(), *text, "c.yaml", files).campaign.method->name(),
            ReadCampaign(methods::All(), parent, "c.yaml", files).campaign.method->name());
}

INSTANTIATE_TEST_SUITE_P(
    Methods, DerivedFrom,
    ::testing::Values("{method: iterative_bayesian_filter, samples: 12, max_iterations: 3, "
                      "freeze: {2: [young_modulus]}, design: sobol}",
                      "{method: sqmc, samples: 24}", "{method: tmcmc, samples: 20, steps: 2}",
                      "{method: surrogate_msrs, samples: 9, in_flight: 2, termination: 16}",
                      "{method: surrogate_msrs, samples: 12, decisions: immediate}"));

TEST(Derive, AnExtensionOfOneIterationMayHaveMore) {
  const auto text =
      Derive(methods::All(),
             "name: a\ninference: {method: sqmc, samples: 96, design: sobol, freeze: {2: [x]}}\n",
             {.name = "b",
              .lineage = {.parent = "c1", .purpose = "extension"},
              .method = "iterative_bayesian_filter",
              .samples = 15,
              .max_iterations = 6});
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_NE(text->find("inference: {method: iterative_bayesian_filter, samples: 15, design: sobol, "
                       "max_iterations: 6}"),
            std::string::npos)
      << *text;
}

TEST(Derive, MoreParametersMayTakeMoreRuns) {
  const auto derived = [](const std::string& inference) {
    const auto text = Derive(
        methods::All(), "name: a\nparameters: {a: {}, b: {}}\ninference: {" + inference + "}\n",
        {.name = "b",
         .lineage = {.parent = "c1", .purpose = "extension"},
         .parameters = {{"e.x", {"uniform", 0, 1}}, {"e.y", {"uniform", 0, 1}}}});
    return text.ok() ? *text : std::string(text.status().message());
  };
  const std::string adaptive = "method: adaptive_emulator";
  // Forty fill the prior, two batches of 6 and 6 that judge.
  EXPECT_THAT(derived(adaptive + ", max_runs: 38"), HasSubstr(adaptive + ", max_runs: 58}"));
  EXPECT_THAT(derived(adaptive + ", max_runs: 60, batch: 20"), HasSubstr("max_runs: 86, batch"));
  EXPECT_THAT(derived(adaptive + ", max_runs: 60, batch: auto"), HasSubstr("max_runs: 60"));
  EXPECT_THAT(derived(adaptive), HasSubstr(adaptive + "}"));
  EXPECT_THAT(derived("method: surrogate_msrs, samples: 5"), HasSubstr("samples: 9}"));
  // Rows of the parent lack the parameters that join.
  EXPECT_THAT(derived(adaptive + ", rows: [{a: 1, b: 2}]"), HasSubstr(adaptive + "}"));
}

// Runs of a table infer nothing, and may be of tests that read other observables.
TEST(Derive, ATableHasNoGroupsOfNoise) {
  for (const auto& [noise, left] : std::vector<std::pair<std::string, std::string>>{
           {"{inferred: [{observables: [y]}]}", "noise: inferred"},
           {"{model_error: [{observables: [y], relative: {prior: uniform, min: 0, max: 1}}]}", ""},
           {"{ess_target: 0.3}", "noise: {ess_target: 0.3}"}}) {
    const std::string parent = "name: a\nnoise: " + noise + "\n";
    const Derivation table{.name = "b",
                           .lineage = {.parent = "c1", .purpose = "prediction"},
                           .rows = {{.like = 0, .values = {{"k", 1}}}}};
    const auto text = Derive(methods::All(), parent, table);
    ASSERT_TRUE(text.ok()) << text.status();
    EXPECT_THAT(*text, HasSubstr(left));
    EXPECT_EQ(text->find("noise") == std::string::npos, left.empty()) << *text;
    const auto extension = Derive(methods::All(), parent, {.name = "b", .lineage = table.lineage});
    ASSERT_TRUE(extension.ok()) << extension.status();
    EXPECT_THAT(*extension, HasSubstr("noise")) << "it infers, as its parent does";
  }
}

TEST(Derive, ABudgetTakesThePlaceOfTheParents) {
  const std::string parent = "name: a\nbudget: {model_evaluations: 400, core_hours: 2}\n";
  const auto text = Derive(methods::All(), parent,
                           {.name = "b",
                            .lineage = {.parent = "c1", .purpose = "extension"},
                            .first_proposal = std::nullopt,
                            .model_evaluations = 37});
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_NE(text->find("budget: {model_evaluations: 37, core_hours: 2}"), std::string::npos)
      << *text;
}

}  // namespace
}  // namespace calib::campaign
