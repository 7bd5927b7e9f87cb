// Campaigns with several materials: what is read, and one sentence for each mistake.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"
#include "server/methods/registry.h"
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

std::string MaterialsYaml() {
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
  const std::string spoiled = absl::StrReplaceAll(MaterialsYaml(), {{from, to}});
  EXPECT_NE(spoiled, MaterialsYaml()) << from;
  return ProblemsOf(spoiled, Files());
}

TEST(MaterialsCampaign, ValuesArePartOfTheModelAndUsesOfTheExperiments) {
  const ReadOutcome outcome =
      ReadCampaign(methods::All(), MaterialsYaml(), "c.yaml", ReaderOf(Files()));
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
  const dem::Scenario scenario = MakeScenario(c, c.experiments[1], {{7e10, 1e10}, 0});
  EXPECT_DOUBLE_EQ(scenario.model.parameters.at("wood.young_modulus"), 1e10);
  EXPECT_EQ(scenario.materials.grains.at("wood"), 0.25);
}

TEST(MaterialsCampaign, PairsHaveValuesOfEffectsOfTheirOwn) {
  const std::string text = absl::StrReplaceAll(
      MaterialsYaml(),
      {{"  density: 2700", "  effects: [rolling_resistance, viscous_damping]\n  density: 2700"},
       {"fixed: {",
        "fixed: {rolling_resistance.stiffness_ratio: 1, "
        "rolling_resistance.friction: 0.1, viscous_damping.ratio: 0.3, "},
       {"steel-grains: {", "steel-grains: {rolling_resistance.friction: 0.02, "},
       {"  wood.young_modulus: default",
        "  wood.young_modulus: default\n"
        "  wood-grains.viscous_damping.ratio: default\n"
        "  wood-wood.rolling_resistance.friction: {prior: uniform, min: 0, max: 0.4}"}});
  const ReadOutcome outcome = ReadCampaign(methods::All(), text, "c.yaml", ReaderOf(Files()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const Campaign& c = outcome.campaign;
  EXPECT_DOUBLE_EQ(c.model.parameters.at("steel-grains.rolling_resistance.friction"), 0.02);
  ASSERT_EQ(c.parameters.size(), 4U);
  EXPECT_EQ(c.parameters[2].name, "wood-grains.viscous_damping.ratio");
  EXPECT_EQ(c.parameters[3].name, "wood-wood.rolling_resistance.friction");
  const dem::Scenario scenario = MakeScenario(c, c.experiments[1], {{7e10, 1e10, 0.2, 0.3}, 0});
  EXPECT_EQ(scenario.model.parameters.at("wood-grains.viscous_damping.ratio"), 0.2);
}

TEST(MaterialsCampaign, AlternativesOfAPairAreOneProblemInWhateverOrder) {
  const auto with = [](const std::string& pairs, const std::string& parameters) {
    return ProblemsOf(
        absl::StrReplaceAll(
            MaterialsYaml(),
            {{"  density: 2700", "  effects: [rolling_resistance]\n  density: 2700"},
             {"fixed: {",
              "fixed: {rolling_resistance.stiffness_ratio: 1, "
              "rolling_resistance.friction: 0.1, "},
             {"steel-grains: {", "steel-grains: {" + pairs},
             {"  wood.young_modulus: default", "  wood.young_modulus: default\n" + parameters}}),
        Files());
  };
  EXPECT_EQ(with("rolling_resistance.stiffness: 1 N m/rad, ", ""), "");
  EXPECT_EQ(
      with("rolling_resistance.stiffness: 1 N m/rad, rolling_resistance.stiffness_ratio: 1, ", ""),
      "c.yaml:7: model.materials: steel-grains.rolling_resistance.stiffness_ratio and "
      "steel-grains.rolling_resistance.stiffness are alternatives: only one of them may be "
      "given\n");
  EXPECT_THAT(with("rolling_resistance.stiffness: 1 N m/rad, ",
                   "  grains-steel.rolling_resistance.stiffness_ratio: default\n"),
              HasSubstr("say the same thing; give one of them"));
}

TEST(MaterialsCampaign, EveryMistakeIsOneSentence) {
  EXPECT_THAT(With("young_modulus: 210 GPa, density", "young_modulu: 210 GPa, density"),
              HasSubstr("model.materials.steel.young_modulu: is nothing that steel may have"));
  EXPECT_THAT(With("210 GPa", "-210 GPa"), HasSubstr("model.materials.steel.young_modulus"));
  EXPECT_THAT(With("steel-grains", "steel-glass"),
              HasSubstr("model.pairs.steel-glass: is no pair A-B of two materials; there are "
                        "grains, steel, wood"));
  EXPECT_THAT(
      With("steel-grains: {friction_coefficient", "steel-grains: {viscous_damping.ratio"),
      HasSubstr("model.pairs.steel-grains.viscous_damping.ratio: is nothing that steel-grains may "
                "have"));
  EXPECT_THAT(
      With("steel-grains: {friction_coefficient: 0.2}", "wood-wood: {friction_coefficient: 0.2}"),
      HasSubstr("model.pairs.wood-wood.friction_coefficient: is nothing that wood-wood may "
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
  EXPECT_THAT(With("    wood: {density", "    wo.od: {density"),
              HasSubstr("model.materials.wo.od: is no name of a material: letters, digits and _ "
                        "only"));
  EXPECT_THAT(With("  density: 2700", "  effects: [wall_friction]\n  density: 2700"),
              HasSubstr("effect wall_friction knows one material only"));
}

TEST(MaterialsCampaign, APairHasOneSourceInWhateverOrder) {
  const std::string parameters = "  wood.young_modulus: default\n";
  EXPECT_EQ(
      With(parameters, parameters + "  steel-grains.friction_coefficient: default\n"),
      "c.yaml:11: parameters: steel-grains.friction_coefficient is both calibrated and fixed; "
      "keep one of them\n");
  EXPECT_EQ(With(parameters, parameters + "  grains-steel.friction_coefficient: default\n"),
            "c.yaml:11: parameters: grains-steel.friction_coefficient and "
            "steel-grains.friction_coefficient are the same; give one of them\n");
  EXPECT_EQ(With(parameters, parameters + "  wood-steel.friction_coefficient: default\n" +
                                 "  steel-wood.friction_coefficient: default\n"),
            "c.yaml:11: parameters: steel-wood.friction_coefficient and "
            "wood-steel.friction_coefficient are the same; give one of them\n");
  EXPECT_EQ(With("fixed: {",
                 "fixed: {wood-steel.friction_coefficient: 0.3, "
                 "steel-wood.friction_coefficient: 0.4, "),
            "c.yaml:5: model.fixed.steel-wood.friction_coefficient: is "
            "wood-steel.friction_coefficient, which is given already; keep one of them\n");
  EXPECT_THAT(With("  pairs:\n", "  pairs:\n    grains-steel: {friction_coefficient: 0.3}\n"),
              HasSubstr("are the same; give one of them"));
}

// E.g. `predict` of a test without the grains that the material is of.
TEST(MaterialsCampaign, OfATableOrDerivedOneMaterialsMayHaveNoPart) {
  const std::string unused = absl::StrReplaceAll(
      MaterialsYaml(),
      {{"partner: steel", "partner: wood"}, {"intruder: steel", "intruder: wood"}});
  const std::string said = "material steel has no part in any of the experiments";
  EXPECT_THAT(ProblemsOf(unused, Files()), HasSubstr(said));
  EXPECT_EQ(ProblemsOf(unused + "lineage: {parent: c1, purpose: warm_fit}\n", Files()), "");
  EXPECT_EQ(ProblemsOf(absl::StrReplaceAll(unused, {{"{samples: 10}",
                                                     "{method: table, rows: [{young_modulus: 7e10, "
                                                     "wood.young_modulus: 1e10}]}"}}),
                       Files()),
            "");
}

TEST(MaterialsCampaign, SamplesOfOnePackingHaveOneMixture) {
  const Campaign c =
      ReadCampaign(methods::All(),
                   absl::StrReplaceAll(
                       MaterialsYaml(),
                       {{"    materials: {walls", "    realizations: 2\n    materials: {walls"}}) +
                       "seed: 40\n",
                   "c.yaml", ReaderOf(Files()))
          .campaign;
  std::vector<std::uint64_t> mixtures;
  std::vector<std::uint64_t> runs;
  for (int sample = 0; sample < 4; ++sample) {
    const dem::Scenario scenario = MakeScenario(c, c.experiments.at(1), {{7e10, 1e10}, sample});
    mixtures.push_back(scenario.materials.seed);
    runs.push_back(scenario.seed);
  }
  EXPECT_THAT(mixtures, ElementsAre(40, 41, 40, 41));
  EXPECT_THAT(runs, ElementsAre(40, 41, 42, 43));
  // Without a mixture nothing is drawn, and equal runs have equal specs.
  EXPECT_EQ(MakeScenario(c, c.experiments.at(0), {{7e10, 1e10}, 1}).materials.seed, 0U);
}

}  // namespace
}  // namespace calib::campaign
