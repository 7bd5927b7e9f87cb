// Effects that no experiment can show are refused: their posterior would be their prior.

#include "server/campaign/model/excitation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Case {
  std::string parameter;
  Experiment experiment;
};

Experiment Of(const std::string& test, std::map<std::string, double> settings = {},
              std::optional<double> loading_rate = {}) {
  Experiment experiment;
  experiment.test = test;
  experiment.settings = std::move(settings);
  experiment.loading_rate = loading_rate;
  return experiment;
}

std::string EffectOf(const Case& c) { return c.parameter.substr(0, c.parameter.find('.')); }

Campaign Calibrating(const Case& c) {
  Campaign campaign;
  campaign.model.effects = {EffectOf(c)};
  campaign.parameters.push_back({.name = c.parameter, .unit = "1", .prior = {}});
  campaign.experiments = {c.experiment};
  return campaign;
}

TEST(Excitation, WhatNoExperimentShowsIsNamed) {
  const std::vector<Case> inert = {
      {"wall_friction.ratio", Of("triaxial_drained")},
      {"wall_friction.coefficient", Of("collision", {{"partner_radius", 1e-3}})},
      {"apparatus_compliance.compliance", Of("isotropic")},
      {"apparatus_compliance.compliance", Of("collision")},
      {"strain_offset.offset", Of("simple_shear")},
      {"load_cell_error.gain", Of("silo_discharge")},
      {"membrane_stiffness.stiffness", Of("oedometric")},
      {"viscous_damping.ratio", Of("triaxial_drained")},
      {"viscous_damping.ratio", Of("isotropic")},
      {"twisting_resistance.stiffness", Of("collision")},
      {"twisting_resistance.friction", Of("collision")},
      {"twisting_resistance.friction", Of("shaken_box")},
      {"twisting_resistance.friction", Of("silo_discharge", {{"flat", 1}})},
      {"nonspherical_shape.aspect", Of("collision")}};
  for (const Case& c : inert) {
    EXPECT_THAT(EffectsWithoutPart(Calibrating(c)),
                ElementsAre(HasSubstr("effect " + EffectOf(c) +
                                      " has no part in any of the experiments: it acts in ")))
        << c.parameter << " in " << c.experiment.test;
  }
}

TEST(Excitation, WhatOneExperimentShowsIsNot) {
  const std::vector<Case> shown = {{"wall_friction.ratio", Of("silo_discharge")},
                                   {"wall_friction.ratio", Of("collision")},
                                   {"apparatus_compliance.compliance", Of("oedometric")},
                                   {"membrane_stiffness.stiffness", Of("triaxial_undrained")},
                                   {"viscous_damping.ratio", Of("triaxial_drained", {}, 0.1)},
                                   {"viscous_damping.ratio", Of("collision")},
                                   {"viscous_damping.ratio", Of("rotating_drum")},
                                   {"twisting_resistance.friction", Of("isotropic")},
                                   {"twisting_resistance.friction", Of("silo_discharge")},
                                   {"rolling_resistance.friction", Of("collision")}};
  for (const Case& c : shown) {
    EXPECT_THAT(EffectsWithoutPart(Calibrating(c)), IsEmpty())
        << c.parameter << " in " << c.experiment.test;
    Campaign beside = Calibrating(c);  // held out, or beside one that does not show it
    beside.experiments.front().role = Role::kValidate;
    beside.experiments.push_back(Of("no_test"));
    EXPECT_THAT(EffectsWithoutPart(beside), IsEmpty()) << c.parameter;
  }
}

TEST(Excitation, WhatIsFixedOrDerivedIsNotAsked) {
  const Case c{"wall_friction.ratio", Of("triaxial_drained")};
  Campaign fixed = Calibrating(c);
  fixed.parameters.front().name = "young_modulus";
  EXPECT_THAT(EffectsWithoutPart(fixed), IsEmpty());
  Campaign table = Calibrating(c);  // e.g. predict of another test
  table.table.emplace();
  EXPECT_THAT(EffectsWithoutPart(table), IsEmpty());
  Campaign derived = Calibrating(c);  // e.g. a warm fit, which leaves held-out experiments away
  derived.lineage = Lineage{.parent = "c1", .purpose = "warm_fit"};
  EXPECT_THAT(EffectsWithoutPart(derived), IsEmpty());
}

// As a file says it: the sentence stands at the model.
TEST(Excitation, AFileIsRefused) {
  std::string yaml = testing::Spoiled("effects: [rolling_resistance]",
                                      "effects: [rolling_resistance, viscous_damping]");
  const std::string at = "  rolling_resistance.friction:";
  yaml.insert(yaml.find(at), "  viscous_damping.ratio: default\n");
  EXPECT_EQ(testing::ProblemsOf(yaml),
            "c.yaml:2: model: effect viscous_damping has no part in any of the experiments: it "
            "acts in tests with a loading_rate, collisions and flows under gravity; readings of "
            "staged tests are taken at rest\n");
  yaml.insert(yaml.find("    role: validate"), "    loading_rate: 0.1 1/s\n");
  EXPECT_EQ(testing::ProblemsOf(yaml), "");
}

}  // namespace
}  // namespace calib::campaign
