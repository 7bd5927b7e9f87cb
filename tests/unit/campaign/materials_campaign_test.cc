// Campaigns with several materials: what is read, and one sentence for each mistake.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using testing::ProblemsOf;
using testing::ReaderOf;

std::map<std::string, std::string> Files() {
  return {{"impacts.csv", "impact_speed,contact_duration\n1,1e-4\n2,9e-5\n4,8e-5\n"},
          {"box.csv", "time,intruder_height\n0.1,0.02\n0.2,0.03\n"}};
}

std::string Yaml() {
  return R"(name: metals
model:
  contact: hertz_mindlin
  density: 2700 kg/m^3
  fixed: {poisson_ratio: 0.33, friction_coefficient: 0.5}
  materials:
    steel: {young_modulus: 210 GPa, density: 7.85 g/cm^3}
    wood: {density: 700, friction_coefficient: 0.4}
  pairs:
    steel-grains: {friction_coefficient: 0.2}
parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  wood.young_modulus: default
experiments:
  - name: impact
    test: collision
    radius: 1 cm
    impact_angle: 0
    materials: {partner: steel}
    data: {file: impacts.csv}
    control: impact_speed
    observables: {contact_duration: {noise: {relative: 0.05}}}
  - name: box
    test: shaken_box
    packing: {generate: {particles: 100, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}
    materials: {walls: wood, intruder: steel, grains: {wood: 25 percent}}
    data: {file: box.csv}
    control: time
    observables: {intruder_height: {noise: {absolute: 1e-3}}}
inference: {samples: 10}
)";
}

std::string With(const std::string& from, const std::string& to) {
  const std::string spoiled = absl::StrReplaceAll(Yaml(), {{from, to}});
  EXPECT_NE(spoiled, Yaml()) << from;
  return ProblemsOf(spoiled, Files());
}

TEST(MaterialsCampaign, ValuesArePartOfTheModelAndUsesOfTheExperiments) {
  const ReadOutcome outcome = ReadCampaign(Yaml(), "c.yaml", ReaderOf(Files()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const Campaign& c = outcome.campaign;
  EXPECT_THAT(c.model.materials, ElementsAre("steel", "wood"));
  EXPECT_DOUBLE_EQ(c.model.parameters.at("steel.young_modulus"), 2.1e11);
  EXPECT_DOUBLE_EQ(c.model.parameters.at("steel.density"), 7850);
  EXPECT_DOUBLE_EQ(c.model.parameters.at("steel-grains.friction_coefficient"), 0.2);
  ASSERT_EQ(c.parameters.size(), 2U);
  EXPECT_EQ(c.parameters[1].name, "wood.young_modulus");
  EXPECT_EQ(c.parameters[1].unit, "Pa");
  ASSERT_EQ(c.experiments.size(), 2U);
  EXPECT_THAT(c.experiments[0].materials.bodies, ElementsAre(Pair("partner", "steel")));
  EXPECT_THAT(c.experiments[1].materials.bodies,
              ElementsAre(Pair("intruder", "steel"), Pair("walls", "wood")));
  EXPECT_THAT(c.experiments[1].materials.grains, ElementsAre(Pair("wood", 0.25)));
  const dem::Scenario scenario = MakeScenario(c, c.experiments[1], {7e10, 1e10}, 0);
  EXPECT_DOUBLE_EQ(scenario.model.parameters.at("wood.young_modulus"), 1e10);
  EXPECT_EQ(scenario.materials.grains.at("wood"), 0.25);
}

TEST(MaterialsCampaign, EveryMistakeIsOneSentence) {
  EXPECT_THAT(With("young_modulus: 210 GPa, density", "young_modulu: 210 GPa, density"),
              HasSubstr("model.materials.steel.young_modulu: is nothing that steel may have"));
  EXPECT_THAT(With("210 GPa", "-210 GPa"), HasSubstr("model.materials.steel.young_modulus"));
  EXPECT_THAT(With("steel-grains", "steel-glass"),
              HasSubstr("model.pairs.steel-glass: is no pair A-B of two materials; there are "
                        "grains, steel, wood"));
  EXPECT_THAT(With("steel-grains: {friction_coefficient", "steel-grains: {damping_ratio"),
              HasSubstr("model.pairs.steel-grains.damping_ratio: is nothing that steel-grains may "
                        "have"));
  EXPECT_THAT(With("wood: {density: 700, ", "wood: {density: 700, young_modulus: 1 GPa, "),
              HasSubstr("wood.young_modulus is both calibrated and fixed"));
  EXPECT_THAT(With("fixed: {", "fixed: {steel.density: 7000, "),
              HasSubstr("model.fixed.steel.density: stands in model.materials or model.pairs"));
  EXPECT_THAT(With("wood.young_modulus: default", "wool.young_modulus: default"),
              HasSubstr("parameters.wool.young_modulus: is not a parameter of hertz_mindlin; did "
                        "you mean"));
  EXPECT_THAT(With("partner: steel", "partner: steal"), HasSubstr("materials.partner"));
  EXPECT_THAT(With("partner: steel", "walls: steel"), HasSubstr("materials.walls"));
  EXPECT_THAT(With("{wood: 25 percent}", "{wool: 25 percent}"),
              HasSubstr("materials.grains.wool: is no material of model.materials"));
  EXPECT_THAT(With("{wood: 25 percent}", "{wood: 125 percent}"), HasSubstr("grains.wood"));
  EXPECT_THAT(With("    wood: {density: 700, friction_coefficient: 0.4}\n",
                   "    wood: {density: 700, friction_coefficient: 0.4}\n    felt: {}\n"),
              HasSubstr("material felt has no part in any of the experiments"));
  EXPECT_THAT(With("  density: 2700", "  effects: [wall_friction]\n  density: 2700"),
              HasSubstr("effect wall_friction knows one material only"));
}

}  // namespace
}  // namespace calib::campaign
