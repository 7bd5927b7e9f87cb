#include "worker/engine/scenario_from_spec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/messages/attempt_spec.h"

namespace calib::worker {
namespace {

TEST(ScenarioFromSpec, IsTheInverseOfToSpec) {
  dem::Scenario scenario;
  scenario.model = {.contact = "hertz_mindlin",
                    .effects = {"rolling_resistance", "twisting_resistance"},
                    .density = 2600.5,
                    .parameters = {{"young_modulus", 0.1 + 0.2}, {"friction_angle", 0.5}},
                    .materials = {"steel", "glass"},
                    .shear_unloading = dem::ShearUnloading::kRescaled};
  scenario.materials = {.bodies = {{"walls", "steel"}}, .grains = {{"glass", 0.3}}, .seed = 77};
  scenario.test = "oedometric";
  scenario.settings = {{"start_pressure", 1e5}};
  scenario.consolidation.porosity = 0.391;
  scenario.initial_stress = dem::InitialStress{.axial = 2e5, .lateral = 1e5};
  scenario.loading_rate = 0.2;
  scenario.staging = {.rate = 0.1,
                      .step = 0.002,
                      .damping_loading = 0.2,
                      .damping_settling = 0.9,
                      .unbalanced = 5e-4,
                      .adaptive = true};
  scenario.path = {{.target = 0.01, .load_step = 0}, {.target = 0.005, .load_step = -1}};
  scenario.seed = 18446744073709551615U;
  const dem::PackingRecipe recipe{.particles = 321,
                                  .porosity = 0.4,
                                  .seed = 9,
                                  .depth_ratio = 1.1,
                                  .grading = {{1e-3, 0}, {2e-3, 1}}};

  const v1::AttemptSpec spec = messages::ToSpec(scenario, recipe, "oedo");
  const dem::Scenario back = ScenarioFromSpec(spec);
  EXPECT_EQ(back.model.contact, scenario.model.contact);
  EXPECT_EQ(back.model.effects, scenario.model.effects);
  EXPECT_EQ(back.model.density, scenario.model.density);
  EXPECT_EQ(back.model.parameters, scenario.model.parameters);
  EXPECT_EQ(back.model.materials, scenario.model.materials);
  EXPECT_EQ(back.model.shear_unloading, dem::ShearUnloading::kRescaled);
  EXPECT_EQ(back.materials.bodies, scenario.materials.bodies);
  EXPECT_EQ(back.materials.grains, scenario.materials.grains);
  EXPECT_EQ(back.materials.seed, 77U);
  EXPECT_EQ(back.settings, scenario.settings);
  EXPECT_EQ(back.consolidation.porosity, scenario.consolidation.porosity);
  EXPECT_FALSE(back.consolidation.friction_coefficient.has_value());
  EXPECT_EQ(back.initial_stress->axial, 2e5);
  EXPECT_EQ(back.loading_rate, scenario.loading_rate);
  EXPECT_EQ(back.staging.unbalanced, scenario.staging.unbalanced);
  EXPECT_TRUE(back.staging.adaptive);
  ASSERT_EQ(back.path.size(), 2U);
  EXPECT_EQ(back.path[1].target, 0.005);
  EXPECT_EQ(back.path[1].load_step, -1);
  EXPECT_EQ(back.seed, scenario.seed);
  EXPECT_EQ(RecipeFromMessage(spec.recipe()).particles, 321);
  EXPECT_EQ(RecipeFromMessage(spec.recipe()).depth_ratio, 1.1);
  EXPECT_EQ(RecipeFromMessage(spec.recipe()).grading[1].radius, 2e-3);
  // Going round once more changes nothing.
  EXPECT_EQ(messages::SpecDigest(messages::ToSpec(back, RecipeFromMessage(spec.recipe()), "x")),
            messages::SpecDigest(spec));
}

TEST(ScenarioFromSpec, UserEffectsTravelWhereTheyAreUsed) {
  dem::UserEffect used;
  used.info.name = "mine";
  used.info.kind = "measurement";
  used.action = dem::FormulaAction::kScales;
  used.target = "axial_stress";
  used.formula = "1 + g * x0";
  used.info.parameters.resize(2);
  used.info.parameters[0].name = "g";
  used.info.parameters[0].min = -1;
  used.info.parameters[0].max = std::numeric_limits<double>::infinity();
  used.info.parameters[1].name = "x0";
  used.info.parameters[1].max = 7;
  used.info.parameters[1].default_value = 0.3;
  dem::UserEffect unused = used;
  unused.info.name = "spare";
  dem::Scenario scenario;
  scenario.model.contact = "linear";
  const v1::AttemptSpec without = messages::ToSpec(scenario, campaign::NoPacking{}, "x");
  scenario.model.user_effects = {unused, used};
  EXPECT_EQ(messages::SpecDigest(messages::ToSpec(scenario, campaign::NoPacking{}, "x")),
            messages::SpecDigest(without));
  scenario.model.effects = {"mine"};
  const v1::AttemptSpec spec = messages::ToSpec(scenario, campaign::NoPacking{}, "x");
  const dem::Scenario back = ScenarioFromSpec(spec);
  ASSERT_EQ(back.model.user_effects.size(), 1U);
  const dem::UserEffect& effect = back.model.user_effects[0];
  EXPECT_EQ(effect.info.name, "mine");
  EXPECT_EQ(effect.info.kind, "measurement");
  EXPECT_EQ(effect.action, dem::FormulaAction::kScales);
  EXPECT_EQ(effect.target, "axial_stress");
  EXPECT_EQ(effect.formula, "1 + g * x0");
  ASSERT_EQ(effect.info.parameters.size(), 2U);
  EXPECT_EQ(effect.info.parameters[0].min, -1);
  EXPECT_TRUE(std::isinf(effect.info.parameters[0].max));
  EXPECT_FALSE(effect.info.parameters[0].default_value.has_value());
  EXPECT_EQ(effect.info.parameters[1].default_value, 0.3);
  scenario.model.user_effects[1].formula = "1 + g";
  EXPECT_NE(messages::SpecDigest(messages::ToSpec(scenario, campaign::NoPacking{}, "x")),
            messages::SpecDigest(spec));
}

TEST(ScenarioFromSpec, WhatIsNotSetStaysUnset) {
  const dem::Scenario scenario = ScenarioFromSpec(v1::AttemptSpec());
  EXPECT_FALSE(scenario.staging.rate.has_value());
  EXPECT_FALSE(scenario.staging.adaptive);
  EXPECT_FALSE(scenario.loading_rate.has_value());
  EXPECT_FALSE(scenario.initial_stress.has_value());
  EXPECT_EQ(scenario.threads, 1);
  EXPECT_EQ(scenario.model.shear_unloading, dem::ShearUnloading::kAsPublished);
}

}  // namespace
}  // namespace calib::worker
