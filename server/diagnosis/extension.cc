#include "server/diagnosis/extension.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/race.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

constexpr double kTempered = 10;  // times the parent's standard deviation
constexpr double kPriorShare = 0.5;
constexpr double kWider = 2;        // times the sd of a posterior by an emulator
constexpr double kDefensive = 0.1;  // share of the prior beside it [Hesterberg, Technometrics 1995]

double SettingOr(const campaign::Experiment& experiment, const std::string& name, double other) {
  const auto found = experiment.settings.find(name);
  return found != experiment.settings.end() ? found->second : other;
}

double DiameterOf(const campaign::Experiment& experiment) {
  for (const campaign::Specimen& specimen : experiment.specimens) {
    if (const auto* recipe = std::get_if<dem::PackingRecipe>(&specimen)) {
      return 2 * recipe->mean_radius;
    }
    const auto* file = std::get_if<campaign::PackingFile>(&specimen);
    if (file == nullptr || file->packing.radius.empty()) continue;
    double sum = 0;
    for (const double r : file->packing.radius) sum += r;
    return 2 * sum / static_cast<double>(file->packing.radius.size());
  }
  return 2 * SettingOr(experiment, "radius", 0.5e-3);  // of a collision
}

double GrainsOf(const campaign::Experiment& experiment) {
  if (experiment.specimens.empty()) return 1;
  if (const auto* recipe = std::get_if<dem::PackingRecipe>(&experiment.specimens.front())) {
    return recipe->particles;
  }
  const auto* file = std::get_if<campaign::PackingFile>(&experiment.specimens.front());
  return file != nullptr ? static_cast<double>(file->packing.radius.size()) : 1;
}

// Of the gentlest collision of an experiment, along the normal [m/s]; infinite: it has none.
double NormalSpeedOf(const campaign::Experiment& experiment) {
  double speed = SettingOr(experiment, "impact_speed", 0);
  double angle = SettingOr(experiment, "impact_angle", 0);
  double slowest = std::numeric_limits<double>::infinity();
  for (const dem::ControlPoint& point : experiment.path) {
    if (experiment.control_name == "impact_speed") speed = point.target;
    if (experiment.control_name == "impact_angle") angle = point.target;
    if (speed > 0) slowest = std::min(slowest, speed * std::cos(angle));
  }
  return slowest;
}

// Contact forces over d^2: the pressure of a specimen, the weight of a filling rho g d N^(1/3). 0:
// the experiment has none.
double PressureOf(const campaign::Experiment& experiment, double density) {
  for (const char* name : {"confining_pressure", "start_pressure", "pressure"}) {
    if (const double pressure = SettingOr(experiment, name, 0); pressure > 0) return pressure;
  }
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  if (test == nullptr || !test->poured) return 0;
  return density * SettingOr(experiment, "gravity", 9.80665) * DiameterOf(experiment) *
         std::cbrt(GrainsOf(experiment));
}

// The same of the gentlest collision, where what attracts shows most and what sticks does so
// first: the peak (rho v^2)^(3/5) E^(2/5) of a Hertzian impact (Johnson, Contact Mechanics, sec.
// 11.4). 0: there is none.
double ImpactPressure(const campaign::Campaign& campaign, double modulus) {
  double slowest = std::numeric_limits<double>::infinity();
  for (const campaign::Experiment& experiment : campaign.experiments) {
    const dem::TestInfo* const test = dem::FindTest(experiment.test);
    if (experiment.role != campaign::Role::kCalibrate || test == nullptr || test->needs_packing) {
      continue;
    }
    slowest = std::min(slowest, NormalSpeedOf(experiment));
  }
  if (!(slowest > 0) || !std::isfinite(slowest)) return 0;
  return std::pow(campaign.model.density * slowest * slowest, 0.6) * std::pow(modulus, 0.4);
}

// Moduli that an extension may move to: a model that lacks an effect bends its modulus to hide it.
struct Moduli {
  double low = 0, high = 0;
};

Moduli ModuliOf(const report::CampaignView& view, double modulus) {
  constexpr double kFurthest = 10;  // times the parent's
  Moduli moduli{.low = modulus, .high = modulus};
  for (const campaign::CalibratedParameter& parameter : view.campaign.parameters) {
    if (parameter.name != "young_modulus") continue;
    const inference::Prior& prior = parameter.prior;
    moduli.low = std::min(modulus, std::max(prior.min, modulus / kFurthest));
    moduli.high = std::max(modulus, std::min(prior.max, modulus * kFurthest));
  }
  return moduli;
}

// Wide enough whatever the modulus turns out to be once the effect is there.
dem::DefaultPrior PriorOver(const Moduli& moduli, const dem::ParameterInfo& parameter,
                            const std::string& contact, dem::ReferenceState state) {
  state.modulus = moduli.low;
  const dem::DefaultPrior soft = dem::PriorOf(parameter, contact, state);
  state.modulus = moduli.high;
  dem::DefaultPrior prior = dem::PriorOf(parameter, contact, state);
  prior.min = std::min(prior.min, soft.min);
  prior.max = std::max(prior.max, soft.max);
  return prior;
}

// What is calibrated of an effect: everything without a default or with a null, alternatives once.
std::map<std::string, dem::DefaultPrior> ParametersOf(const dem::EffectInfo& effect,
                                                      const std::string& contact,
                                                      const dem::ReferenceState& state,
                                                      const Moduli& moduli) {
  std::map<std::string, dem::DefaultPrior> chosen;
  std::vector<std::string> covered;
  const auto on_ray = [&effect](const std::string& name) {
    return std::any_of(effect.rays.begin(), effect.rays.end(),
                       [&name](const dem::StrengthRay& ray) { return ray.parameter == name; });
  };
  for (const bool strengths : {true, false}) {
    for (const dem::ParameterInfo& parameter : effect.parameters) {
      if (on_ray(parameter.name) != strengths) continue;
      if (!strengths && parameter.default_value) continue;
      const std::string& other = parameter.alternative_to;
      const bool said = std::any_of(covered.begin(), covered.end(), [&](const std::string& name) {
        const auto same =
            std::find_if(effect.parameters.begin(), effect.parameters.end(),
                         [&name](const dem::ParameterInfo& p) { return p.name == name; });
        return name == other || same->alternative_to == parameter.name;
      });
      if (said) continue;
      covered.push_back(parameter.name);
      chosen[absl::StrCat(effect.name, ".", parameter.name)] =
          PriorOver(moduli, parameter, contact, state);
    }
  }
  return chosen;
}

// At the means of the posterior; empty: the modulus is not tied to other parameters.
std::optional<double> TiedModulus(const report::CampaignView& view) {
  std::vector<double> means = campaign::MiddleValues(view.campaign);
  for (std::size_t j = 0; j < means.size(); ++j) {
    for (const auto& known : view.posterior.parameters()) {
      if (known.name() == view.campaign.parameters[j].name) means[j] = known.mean();
    }
  }
  const std::vector<double> tied = campaign::TiedValues(view.campaign, means);
  for (std::size_t k = 0; k < tied.size(); ++k) {
    if (view.campaign.tied[k].name == "young_modulus") return tied[k];
  }
  return std::nullopt;
}

}  // namespace

dem::ReferenceState ReferenceOf(const report::CampaignView& view) {
  dem::ReferenceState state{.pressure = 1e5, .diameter = 1e-3, .modulus = 1e9};
  const dem::Model& model = view.campaign.model;
  const auto fixed = model.parameters.find("young_modulus");
  if (fixed != model.parameters.end()) state.modulus = fixed->second;
  for (const auto& parameter : view.posterior.parameters()) {
    if (parameter.name() == "young_modulus") state.modulus = parameter.mean();
  }
  if (const auto tied = TiedModulus(view); tied) state.modulus = *tied;
  double sum = 0;
  int count = 0;
  const auto take = [&sum, &count](double pressure) {
    if (!(pressure > 0)) return;
    sum += std::log(pressure);
    ++count;
  };
  for (const campaign::Experiment& experiment : view.campaign.experiments) {
    if (experiment.role != campaign::Role::kCalibrate) continue;
    state.diameter = DiameterOf(experiment);
    take(PressureOf(experiment, model.density));
  }
  take(ImpactPressure(view.campaign, state.modulus));
  if (count > 0) state.pressure = std::exp(sum / count);
  return state;
}

std::map<std::string, dem::DefaultPrior> PriorsOfExtension(const report::CampaignView& parent,
                                                           const dem::EffectInfo& effect) {
  const dem::ReferenceState state = ReferenceOf(parent);
  return ParametersOf(effect, parent.campaign.model.contact, state,
                      ModuliOf(parent, state.modulus));
}

std::string WhyNotJoin(const campaign::Campaign& campaign, const std::string& name) {
  const auto& declared = campaign.model.user_effects;
  if (dem::FindEffect(declared, name) == nullptr) {
    std::vector<std::string> names;
    for (const dem::EffectInfo* info : dem::AllEffects(declared)) names.push_back(info->name);
    return absl::StrCat("there is no effect ", name, "; this build has ",
                        absl::StrJoin(names, ", "));
  }
  const auto& has = campaign.model.effects;
  if (std::find(has.begin(), has.end(), name) != has.end()) {
    return absl::StrCat(name, " is part of the model already");
  }
  if (!campaign::HasOwnEngine(campaign)) {
    const bool is_own =
        std::any_of(declared.begin(), declared.end(),
                    [&name](const dem::UserEffect& effect) { return effect.info.name == name; });
    if (!is_own && campaign.program) {
      return absl::StrCat(
          "the program of this campaign knows no ", name,
          "; `calibctl diagnose` says what it would change, and what the program can switch on is "
          "declared under model.effects");
    }
    if (!is_own) {
      return absl::StrCat(
          "runs that were made elsewhere cannot be joined by ", name,
          "; `calibctl diagnose` says what instruments or a denser start would change of them, and "
          "runs that your code makes with an effect go into the same tables, declared under "
          "model.precomputed.effects");
    }
    for (const std::string& other : has) {
      if (dem::Exclude(*dem::FindEffect(declared, name), *dem::FindEffect(declared, other)))
        return absl::StrCat(name, " excludes ", other, ", which acts");
    }
    return "";
  }
  return campaign::WhyNotTogether(campaign, {name});
}

absl::StatusOr<std::string> ExtensionText(const report::CampaignView& parent,
                                          const ExtensionPlan& plan) {
  if (parent.posterior.posterior_from().empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("no iteration of campaign ", parent.status.campaign(),
                     " is complete, so there is nothing to start from"));
  }
  const dem::ReferenceState state = ReferenceOf(parent);
  const Moduli moduli = ModuliOf(parent, state.modulus);
  campaign::Derivation derivation{
      .name = absl::StrCat(parent.campaign.name, " + ", absl::StrJoin(plan.effects, " + ")),
      .lineage = {.parent = parent.status.campaign(), .purpose = plan.purpose},
      .effects = plan.effects,
      .parameters = {},
      .held_out = plan.held_out,
      .method = plan.method,
      .samples = plan.samples,
      .max_iterations = plan.iterations,
      .first_proposal =
          campaign::FirstProposal{.prior_share = plan.near.empty() ? kPriorShare : kDefensive,
                                  .places = {}},
      .model_evaluations = plan.model_evaluations,
      .rows = plan.given};
  campaign::Campaign grown = parent.campaign;
  for (const std::string& name : plan.effects) {
    if (const std::string why = WhyNotJoin(grown, name); !why.empty()) {
      return absl::InvalidArgumentError(why);
    }
    grown.model.effects.push_back(name);
    derivation.parameters.merge(
        ParametersOf(*dem::FindEffect(parent.campaign.model.user_effects, name),
                     parent.campaign.model.contact, state, moduli));
  }
  for (int j = 0; j < parent.posterior.parameters_size(); ++j) {
    const v1::Posterior::Parameter& parameter = parent.posterior.parameters(j);
    const inference::Prior& prior = parent.campaign.parameters[static_cast<std::size_t>(j)].prior;
    if (!(parameter.sd() > 0) || !prior.InSupport(parameter.mean())) continue;
    derivation.first_proposal->places[parameter.name()] = {.center = parameter.mean(),
                                                           .sd = kTempered * parameter.sd()};
  }
  for (const auto& [name, place] : plan.near) {
    if (place.sd > 0)
      derivation.first_proposal->places[name] = {.center = place.center, .sd = kWider * place.sd};
  }
  if (parent.campaign.precomputed || !parent.campaign.method->takes_first_proposal()) {
    derivation.first_proposal.reset();  // nothing is run, or all of the prior is
  }
  return campaign::Derive(methods::All(), parent.source.campaign_file(), derivation);
}

}  // namespace calib::diagnosis
