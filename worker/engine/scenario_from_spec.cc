#include "worker/engine/scenario_from_spec.h"

#include <algorithm>
#include <utility>

#include "dem/formula/user_effect.h"

namespace calib::worker {
namespace {

dem::Staging StagingFromMessage(const v1::Staging& message) {
  dem::Staging staging;
  if (message.has_rate()) {
    staging.rate = message.rate();
  }
  if (message.has_step()) {
    staging.step = message.step();
  }
  if (message.has_damping_loading()) {
    staging.damping_loading = message.damping_loading();
  }
  if (message.has_damping_settling()) {
    staging.damping_settling = message.damping_settling();
  }
  if (message.has_unbalanced()) {
    staging.unbalanced = message.unbalanced();
  }
  staging.adaptive = message.adaptive();
  return staging;
}

dem::UserEffect UserEffectFromMessage(const v1::UserEffect& message) {
  dem::UserEffect effect;
  effect.info.name = message.name();
  effect.info.kind = dem::KindOfTarget(message.target());
  effect.action = message.scales() ? dem::FormulaAction::kScales : dem::FormulaAction::kAdds;
  effect.target = message.target();
  effect.formula = message.formula();
  for (const v1::UserParameter& parameter : message.parameters()) {
    dem::ParameterInfo info;
    info.name = parameter.name();
    info.min = parameter.min();
    info.max = parameter.max();
    if (parameter.has_default_value()) {
      info.default_value = parameter.default_value();
    }
    effect.info.parameters.push_back(std::move(info));
  }
  return effect;
}

}  // namespace

dem::Scenario ScenarioFromSpec(const v1::AttemptSpec& spec) {
  dem::Scenario scenario;
  scenario.model.contact = spec.contact();
  scenario.model.effects.assign(spec.effects().begin(), spec.effects().end());
  for (const v1::UserEffect& effect : spec.user_effects()) {
    scenario.model.user_effects.push_back(UserEffectFromMessage(effect));
  }
  scenario.model.density = spec.density();
  scenario.model.parameters.insert(spec.parameters().begin(), spec.parameters().end());
  scenario.model.shear_unloading =
      spec.shear_rescaled() ? dem::ShearUnloading::kRescaled : dem::ShearUnloading::kAsPublished;
  scenario.model.materials.assign(spec.materials().begin(), spec.materials().end());
  scenario.materials.bodies.insert(spec.body_materials().begin(), spec.body_materials().end());
  scenario.materials.grains.insert(spec.grain_materials().begin(), spec.grain_materials().end());
  scenario.materials.seed = spec.mixture_seed();
  scenario.test = spec.test();
  scenario.settings.insert(spec.settings().begin(), spec.settings().end());
  if (spec.has_consolidation_friction()) {
    scenario.consolidation.friction_coefficient = spec.consolidation_friction();
  }
  if (spec.has_consolidation_porosity()) {
    scenario.consolidation.porosity = spec.consolidation_porosity();
  }
  if (spec.has_initial_axial_stress()) {
    scenario.initial_stress = dem::InitialStress{.axial = spec.initial_axial_stress(),
                                                 .lateral = spec.initial_lateral_stress()};
  }
  if (spec.has_loading_rate()) {
    scenario.loading_rate = spec.loading_rate();
  }
  scenario.staging = StagingFromMessage(spec.staging());
  for (const v1::ControlPoint& point : spec.path()) {
    scenario.path.push_back({.target = point.target(), .load_step = point.load_step()});
  }
  scenario.threads = std::max(1, spec.threads());
  scenario.seed = spec.seed();
  return scenario;
}

dem::PackingRecipe RecipeFromMessage(const v1::PackingRecipe& message) {
  dem::PackingRecipe recipe{.particles = message.particles(),
                            .porosity = message.porosity(),
                            .mean_radius = message.mean_radius(),
                            .radius_spread = message.radius_spread(),
                            .aspect = message.aspect(),
                            .pressure = message.pressure(),
                            .seed = message.seed()};
  if (message.has_depth_ratio()) {
    recipe.depth_ratio = message.depth_ratio();
  }
  for (const v1::GradingPoint& point : message.grading()) {
    recipe.grading.push_back({.radius = point.radius(), .finer = point.finer()});
  }
  return recipe;
}

}  // namespace calib::worker
