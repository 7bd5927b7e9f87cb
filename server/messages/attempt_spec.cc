#include "server/messages/attempt_spec.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/digest.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/run_settings.h"
#include "server/campaign/model/sha256.h"

namespace calib::messages {
namespace {

void SetSpecimen(const campaign::PackingFile& file, v1::AttemptSpec& spec) {
  spec.set_packing_digest(file.digest);
}

void SetSpecimen(const dem::PackingRecipe& recipe, v1::AttemptSpec& spec) {
  v1::PackingRecipe& message = *spec.mutable_recipe();
  message.set_particles(recipe.particles);
  message.set_porosity(recipe.porosity);
  message.set_mean_radius(recipe.mean_radius);
  message.set_radius_spread(recipe.radius_spread);
  message.set_aspect(recipe.aspect);
  message.set_pressure(recipe.pressure);
  message.set_seed(recipe.seed);
  if (recipe.depth_ratio != 1) message.set_depth_ratio(recipe.depth_ratio);
  for (const dem::GradingPoint& point : recipe.grading) {
    v1::GradingPoint& added = *message.add_grading();
    added.set_radius(point.radius);
    added.set_finer(point.finer);
  }
}

void SetSpecimen(const campaign::PackingLike& like, v1::AttemptSpec& spec) {
  SetSpecimen(like.recipe, spec);
  spec.mutable_recipe()->set_sizes_digest(like.digest);
}

void SetSpecimen(const campaign::NoPacking& /*none*/, v1::AttemptSpec& /*spec*/) {}

void SetSpecimen(const campaign::ProgramSpecimen& /*none*/, v1::AttemptSpec& /*spec*/) {}

v1::Staging ToMessage(const dem::Staging& staging) {
  v1::Staging message;
  if (staging.rate.has_value()) {
    message.set_rate(*staging.rate);
  }
  if (staging.step.has_value()) {
    message.set_step(*staging.step);
  }
  if (staging.damping_loading.has_value()) {
    message.set_damping_loading(*staging.damping_loading);
  }
  if (staging.damping_settling.has_value()) {
    message.set_damping_settling(*staging.damping_settling);
  }
  if (staging.unbalanced.has_value()) {
    message.set_unbalanced(*staging.unbalanced);
  }
  message.set_adaptive(staging.adaptive);
  return message;
}

void SetLimits(const campaign::ProgramLimits& limits, v1::ProgramLimits& message) {
  if (limits.wall) message.set_wall(*limits.wall);
  if (limits.memory) message.set_memory(*limits.memory);
  if (limits.disk) message.set_disk(*limits.disk);
  if (limits.silence) message.set_silence(*limits.silence);
}

/// Bytes that a run of the DEM may have where its campaign states none, on however many slots a
/// node was cut into. Chosen: an engine has 40 MB before its run, one of 1e5 grains some hundred.
constexpr double kLeastLimit = 256e6;

// The columns that the observables of an experiment are read from.
v1::ProgramTable TableOf(const campaign::ProgramTable& table,
                         const campaign::Experiment& experiment) {
  v1::ProgramTable message;
  message.set_file(table.file);
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    v1::ProgramColumn& column = *message.add_columns();
    column.set_name(observable.name);
    const auto named = table.columns.find(observable.name);
    column.set_column(named != table.columns.end() ? named->second : observable.name);
    const auto factor = table.factors.find(observable.name);
    column.set_factor(factor != table.factors.end() ? factor->second : 1);
  }
  return message;
}

// Whether it is an effect that the campaign's program may switch on.
bool IsDeclared(const campaign::Campaign& campaign, const std::string& effect) {
  const auto& declared = campaign.model.user_effects;
  return std::any_of(declared.begin(), declared.end(),
                     [&effect](const dem::UserEffect& own) { return own.info.name == effect; });
}

// Declared effects that the model does not use have no part in what a run is.
void SetUserEffects(const dem::Model& model, v1::AttemptSpec& spec) {
  for (const dem::UserEffect& effect : model.user_effects) {
    if (std::find(model.effects.begin(), model.effects.end(), effect.info.name) ==
        model.effects.end()) {
      continue;
    }
    v1::UserEffect& message = *spec.add_user_effects();
    message.set_name(effect.info.name);
    message.set_scales(effect.action == dem::FormulaAction::kScales);
    message.set_target(effect.target);
    message.set_formula(effect.formula);
    for (const dem::ParameterInfo& p : effect.info.parameters) {
      v1::UserParameter& parameter = *message.add_parameters();
      parameter.set_name(p.name);
      parameter.set_min(p.min);
      parameter.set_max(p.max);
      if (p.default_value) parameter.set_default_value(*p.default_value);
    }
  }
}

}  // namespace

v1::AttemptSpec ToSpec(const dem::Scenario& scenario, const campaign::Specimen& specimen,
                       const std::string& experiment) {
  v1::AttemptSpec spec;
  spec.set_contact(scenario.model.contact);
  spec.mutable_effects()->Add(scenario.model.effects.begin(), scenario.model.effects.end());
  spec.set_density(scenario.model.density);
  spec.mutable_parameters()->insert(scenario.model.parameters.begin(),
                                    scenario.model.parameters.end());
  spec.set_test(scenario.test);
  spec.mutable_settings()->insert(scenario.settings.begin(), scenario.settings.end());
  std::visit([&spec](const auto& known) { SetSpecimen(known, spec); }, specimen);
  if (scenario.consolidation.friction_coefficient.has_value()) {
    spec.set_consolidation_friction(*scenario.consolidation.friction_coefficient);
  }
  if (scenario.consolidation.porosity.has_value()) {
    spec.set_consolidation_porosity(*scenario.consolidation.porosity);
  }
  if (scenario.initial_stress.has_value()) {
    spec.set_initial_axial_stress(scenario.initial_stress->axial);
    spec.set_initial_lateral_stress(scenario.initial_stress->lateral);
  }
  if (scenario.loading_rate.has_value()) {
    spec.set_loading_rate(*scenario.loading_rate);
  }
  *spec.mutable_staging() = ToMessage(scenario.staging);
  for (const dem::ControlPoint& point : scenario.path) {
    v1::ControlPoint& message = *spec.add_path();
    message.set_target(point.target);
    message.set_load_step(point.load_step);
  }
  spec.set_seed(scenario.seed);
  spec.set_threads(scenario.threads);
  spec.set_experiment(experiment);
  SetUserEffects(scenario.model, spec);
  spec.mutable_materials()->Add(scenario.model.materials.begin(), scenario.model.materials.end());
  spec.mutable_body_materials()->insert(scenario.materials.bodies.begin(),
                                        scenario.materials.bodies.end());
  spec.mutable_grain_materials()->insert(scenario.materials.grains.begin(),
                                         scenario.materials.grains.end());
  if (!scenario.materials.grains.empty()) spec.set_mixture_seed(scenario.materials.seed);
  spec.set_shear_rescaled(scenario.model.shear_unloading == dem::ShearUnloading::kRescaled);
  return spec;
}

v1::AttemptSpec SpecOf(const campaign::Campaign& campaign, int experiment,
                       const campaign::RunOf& run) {
  const campaign::Experiment& measured = campaign.experiments[static_cast<std::size_t>(experiment)];
  const auto specimen = static_cast<std::size_t>(run.stream) % measured.specimens.size();
  const dem::Scenario scenario = campaign::MakeScenario(campaign, measured, run);
  const auto changed = campaign::ChangedRecipe(campaign, measured, run);
  v1::AttemptSpec spec = changed ? ToSpec(scenario, *changed, measured.name)
                                 : ToSpec(scenario, measured.specimens[specimen], measured.name);
  for (const auto& [name, file] : measured.meshes) {
    v1::Mesh& message = *spec.add_meshes();
    message.set_name(name);
    message.set_digest(file.digest);
    message.set_scale(file.scale);
  }
  return spec;
}

v1::ProgramRun ProgramRunOf(const campaign::Campaign& campaign, int experiment,
                            const campaign::RunOf& run) {
  const campaign::Program& program = *campaign.program;
  const campaign::Experiment& measured = campaign.experiments[static_cast<std::size_t>(experiment)];
  v1::ProgramRun message;
  message.mutable_command()->Add(program.command.begin(), program.command.end());
  for (const campaign::ProgramFile& file : program.files) {
    v1::ProgramFile& added = *message.add_files();
    added.set_name(file.name);
    added.set_digest(file.digest);
    added.set_executable(file.executable);
    added.set_is_template(file.is_template);
  }
  message.mutable_keep()->Add(program.keep.begin(), program.keep.end());
  message.set_checkpoint(program.checkpoint);
  message.set_persistent(program.persistent);
  if (program.states) *message.mutable_states() = TableOf(*program.states, measured);
  SetLimits(program.limits, *message.mutable_limits());
  message.set_limit_diverges(program.limit_diverges);
  message.set_version(program.version);
  message.set_experiment(measured.name);
  message.set_test(measured.test);
  const auto realization = static_cast<std::size_t>(run.stream) % measured.specimens.size();
  message.set_realization(static_cast<int>(realization));
  dem::Model model = campaign::ModelOf(campaign, measured, run.values);
  // Effects of the measurement are calculated on what the program answers; it knows none of them.
  std::erase_if(model.effects,
                [&campaign](const std::string& name) { return !IsDeclared(campaign, name); });
  std::erase_if(model.parameters, [&campaign](const auto& parameter) {
    const std::string effect = campaign::EffectNamedIn(parameter.first);
    const auto& race = campaign.race;
    return std::find(race.begin(), race.end(), effect) != race.end() &&
           !IsDeclared(campaign, effect);
  });
  message.mutable_parameters()->insert(model.parameters.begin(), model.parameters.end());
  for (const auto& [name, value] : campaign::NumericsOf(campaign, run.values)) {
    (*message.mutable_parameters())[name] = value;
  }
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    if (model.parameters.contains(parameter.name)) {
      (*message.mutable_units())[parameter.name] = parameter.unit;
    }
  }
  for (const campaign::TiedParameter& tied : campaign.tied) {
    (*message.mutable_units())[tied.name] = tied.unit;
  }
  message.mutable_effects()->Add(model.effects.begin(), model.effects.end());
  campaign::ProgramSettings told = measured.told;
  if (const auto* own = std::get_if<campaign::ProgramSpecimen>(&measured.specimens[realization])) {
    told.insert(own->settings.begin(), own->settings.end());
  }
  std::vector<std::string> members;
  for (const auto& [name, value] : told) {
    members.push_back(absl::StrCat(nlohmann::json(name).dump(), ":", value));
  }
  message.set_settings(absl::StrCat("{", absl::StrJoin(members, ","), "}"));
  message.set_control(measured.control_name);
  for (const dem::ControlPoint& point : measured.path) {
    if (point.load_step >= 0) message.add_control_values(point.target);
  }
  for (const campaign::MeasuredObservable& observable : measured.observables) {
    message.add_observables(observable.name);
  }
  constexpr std::uint64_t kLargestSeed = 0x7fffffff;
  message.set_seed(static_cast<int>((campaign.seed + realization) & kLargestSeed));
  return message;
}

v1::Lease LeaseOf(const campaign::Campaign& campaign, int experiment, const campaign::RunOf& run) {
  v1::Lease lease;
  if (campaign.program) {
    *lease.mutable_program() = ProgramRunOf(campaign, experiment, run);
  } else {
    *lease.mutable_spec() = SpecOf(campaign, experiment, run);
  }
  return lease;
}

std::string SpecDigest(v1::AttemptSpec spec) {
  spec.clear_experiment();
  spec.clear_threads();
  return campaign::Sha256Hex(absl::StrCat(dem::EngineVersion(), "\n", rpc::BytesOf(spec)));
}

void SetResources(const campaign::Campaign& campaign, const RunShare& share, v1::Lease& lease) {
  const campaign::Resources& needs = campaign.resources;
  constexpr int kMostThreads = 4096;  // as a lease can say
  const int threads = std::min(needs.threads.value_or(share.threads), kMostThreads);
  std::optional<double> memory = needs.memory;
  if (lease.has_program()) {
    lease.mutable_program()->set_threads(threads);
    v1::ProgramLimits& limits = *lease.mutable_program()->mutable_limits();
    if (memory.has_value() && !limits.has_memory()) limits.set_memory(*memory);
    return;
  }
  lease.mutable_spec()->set_threads(threads);
  if (!memory.has_value() && share.memory > 0) memory = std::max(share.memory, kLeastLimit);
  v1::ProgramLimits& limits = *lease.mutable_limits();
  if (memory.has_value()) limits.set_memory(*memory);
  if (needs.wall.has_value()) limits.set_wall(*needs.wall);
  limits.set_silence(needs.silence.value_or(campaign::kLongestSilence));
}

std::string RunDigest(v1::Lease run) {
  if (run.has_program()) {
    v1::ProgramRun& program = *run.mutable_program();
    program.clear_threads();
    program.clear_limits();
    program.clear_limit_diverges();
    program.clear_keep();
    return campaign::Sha256Hex(absl::StrCat("program\n", rpc::BytesOf(program)));
  }
  return SpecDigest(std::move(*run.mutable_spec()));
}

}  // namespace calib::messages
