#include "server/campaign/model/race.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/model/staging.h"
#include "dem/particles/random_cloud.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/model/excitation.h"
#include "server/campaign/model/run_settings.h"
#include "server/campaign/model/tied_parameters.h"

namespace calib::campaign {
namespace {

constexpr double kMostDamping = 0.9;  // that of a settling: more is hardly motion any more
/// Chosen: a study of numerics goes by twos, and beyond this nothing quasi-static is left.
constexpr double kMostChange = 100;

dem::ParameterInfo Factor(const char* name, const char* on) {
  dem::ParameterInfo info;
  info.name = name;
  info.unit = "1";
  info.min = 1 / kMostChange;
  info.max = kMostChange;
  info.default_prior = {.kind = "log_uniform", .min = 0.5, .max = 2};
  info.default_value = 1;
  info.null_value = 1;
  info.description = absl::StrCat("factor on the ", on, " of staged tests");
  return info;
}

std::string PrefixOfNumerics() { return absl::StrCat(kNumerics, "."); }

// What the program of the campaign declares under a dotted name; nullptr: nothing.
const ProgramNumerics* NumericsOfProgram(const Campaign& campaign, const std::string& name) {
  const std::string prefix = PrefixOfNumerics();
  if (!campaign.program || !name.starts_with(prefix)) return nullptr;
  const auto found = campaign.program->numerics.find(name.substr(prefix.size()));
  return found == campaign.program->numerics.end() ? nullptr : &found->second;
}

bool IsOneOf(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The parameter of an effect that a dotted name ends in.
const dem::ParameterInfo* ParameterIn(const dem::EffectInfo& effect, const std::string& name) {
  const std::string own = name.substr(name.rfind('.') + 1);
  for (const dem::ParameterInfo& info : effect.parameters) {
    if (info.name == own) return &info;
  }
  return nullptr;
}

bool IsOnRay(const dem::EffectInfo& effect, const std::string& name) {
  const std::string own = name.substr(name.rfind('.') + 1);
  return std::any_of(effect.rays.begin(), effect.rays.end(),
                     [&own](const dem::StrengthRay& ray) { return ray.parameter == own; });
}

const dem::EffectInfo* FindRacing(const Campaign& campaign, const std::string& effect) {
  return IsOneOf(campaign.race, effect) ? dem::FindEffect(campaign.model.user_effects, effect)
                                        : nullptr;
}

bool HasClumps(const Experiment& experiment) {
  return std::any_of(experiment.specimens.begin(), experiment.specimens.end(),
                     [](const Specimen& specimen) {
                       const auto* file = std::get_if<PackingFile>(&specimen);
                       return file != nullptr &&
                              std::any_of(file->packing.clump.begin(), file->packing.clump.end(),
                                          [](int clump) { return clump >= 0; });
                     });
}

// Mean diameter of the grains of the first specimen [m], as the engine takes it. Precondition: the
// test needs a packing.
double MeanDiameter(const Campaign& campaign, const Experiment& experiment,
                    const std::vector<double>& values) {
  const Specimen& first = experiment.specimens.front();
  const auto* file = std::get_if<PackingFile>(&first);
  const auto changed = ChangedRecipe(campaign, experiment, {.values = values, .stream = 0});
  const std::vector<double> radii = file != nullptr ? file->packing.radius
                                    : changed       ? dem::RadiiOf(*changed)
                                              : dem::RadiiOf(std::get<dem::PackingRecipe>(first));
  return 2 * std::accumulate(radii.begin(), radii.end(), 0.0) / static_cast<double>(radii.size());
}

}  // namespace

const dem::ParameterInfo* FindNumerics(const std::string& name) {
  static const std::array kFactors = {Factor("rate", "rate"), Factor("step", "step"),
                                      Factor("damping", "damping while straining")};
  for (const dem::ParameterInfo& info : kFactors) {
    if (name == absl::StrCat(kNumerics, ".", info.name)) return &info;
  }
  return nullptr;
}

bool IsNumerics(const Campaign& campaign, const std::string& name) {
  return campaign.program ? NumericsOfProgram(campaign, name) != nullptr
                          : FindNumerics(name) != nullptr;
}

std::map<std::string, double> NumericsOf(const Campaign& campaign, std::span<const double> values) {
  std::map<std::string, double> told;
  if (!campaign.program) return told;
  for (const auto& [name, choice] : campaign.program->numerics) told[name] = choice.null;
  if (!RunsAreAdded(campaign)) return told;
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const std::string& name = campaign.parameters[j].name;
    if (IsNumerics(campaign, name)) told[name.substr(PrefixOfNumerics().size())] = values[j];
  }
  return told;
}

std::string EffectNamedIn(const std::string& parameter) {
  if (parameter.find('@') != std::string::npos) return "";  // of a label, which may be any word
  const std::size_t last = parameter.rfind('.');
  if (last == std::string::npos) return "";
  const std::size_t before = parameter.rfind('.', last - 1);
  const std::size_t begin = last == 0 || before == std::string::npos ? 0 : before + 1;
  return parameter.substr(begin, last - begin);
}

dem::Model ModelWithRace(const Campaign& campaign) {
  dem::Model model = campaign.model;
  model.effects.insert(model.effects.end(), campaign.race.begin(), campaign.race.end());
  return model;
}

std::optional<double> NullOf(const Campaign& campaign, const std::string& parameter) {
  if (!RunsAreAdded(campaign)) return std::nullopt;
  if (IsNumerics(campaign, parameter)) {
    return campaign.program ? NumericsOfProgram(campaign, parameter)->null
                            : FindNumerics(parameter)->null_value;
  }
  const dem::EffectInfo* effect = FindRacing(campaign, EffectNamedIn(parameter));
  const dem::ParameterInfo* info = effect == nullptr ? nullptr : ParameterIn(*effect, parameter);
  if (info == nullptr) return std::nullopt;
  return dem::NullValueOf(*info, campaign.model.contact);
}

std::vector<std::string> StrengthsOf(const Campaign& campaign, const std::string& effect) {
  std::vector<std::string> names;
  const dem::EffectInfo* info = FindRacing(campaign, effect);
  if (info == nullptr) return names;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    if (EffectNamedIn(parameter.name) == effect && IsOnRay(*info, parameter.name)) {
      names.push_back(parameter.name);
    }
  }
  return names;
}

std::vector<std::string> ActiveEffects(const Campaign& campaign, std::span<const double> values) {
  std::vector<std::string> active;
  for (const std::string& effect : campaign.race) {
    const std::vector<std::string> strengths = StrengthsOf(campaign, effect);
    for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
      const std::string& name = campaign.parameters[j].name;
      // Compared exactly: a strength next to nothing is a run of its own.
      if (IsOneOf(strengths, name) && values[j] != NullOf(campaign, name)) {
        active.push_back(effect);
        break;
      }
    }
  }
  return active;
}

dem::Model ModelOf(const Campaign& campaign, const Experiment& experiment,
                   std::span<const double> common) {
  const std::vector<double> values = ValuesIn(campaign, experiment, common);
  dem::Model model = campaign.model;
  const std::vector<std::string> active = ActiveEffects(campaign, values);
  model.effects.insert(model.effects.end(), active.begin(), active.end());
  const bool is_design = RunsAreAdded(campaign);
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const std::string& name = campaign.parameters[j].name;
    const std::string effect = EffectNamedIn(name);
    const bool absent =
        campaign.parameters[j].setting || campaign.parameters[j].of_population ||
        (is_design && (IsNumerics(campaign, name) ||
                       (IsOneOf(campaign.race, effect) && !IsOneOf(active, effect))));
    if (!absent) model.parameters[name] = values[j];
  }
  const std::vector<double> tied = TiedValues(campaign, values);
  for (std::size_t k = 0; k < tied.size(); ++k) {
    if (!campaign.tied[k].setting) model.parameters[campaign.tied[k].name] = tied[k];
  }
  return model;
}

void ChangeNumerics(const Campaign& campaign, const Experiment& experiment, const RunOf& run,
                    dem::Scenario& scenario) {
  const std::vector<double>& values = run.values;
  if (!RunsAreAdded(campaign) || !ReadAtRest(experiment)) return;
  std::optional<dem::Staging> used;
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const dem::ParameterInfo* factor = FindNumerics(campaign.parameters[j].name);
    if (factor == nullptr || values[j] == *factor->null_value) continue;
    if (!used) used = dem::ResolveStaging(scenario, MeanDiameter(campaign, experiment, values));
    if (factor->name == "rate") scenario.staging.rate = *used->rate * values[j];
    if (factor->name == "step") scenario.staging.step = *used->step * values[j];
    if (factor->name == "damping") {
      const double changed = *used->damping_loading * values[j];
      scenario.staging.damping_loading =
          changed > kMostDamping ? *used->damping_loading / values[j] : changed;
    }
  }
}

std::string WhyNotTogether(const Campaign& campaign, const std::vector<std::string>& effects) {
  dem::Model model = campaign.model;
  for (const std::string& name : effects) {
    const dem::EffectInfo* effect = dem::FindEffect(campaign.model.user_effects, name);
    if (effect == nullptr) return absl::StrCat("there is no effect ", name);
    if (!effect->contacts.empty() && !IsOneOf(effect->contacts, campaign.model.contact)) {
      return absl::StrCat(name, " cannot join the contact ", campaign.model.contact,
                          "; it works with ", absl::StrJoin(effect->contacts, ", "));
    }
    for (const std::string& other : model.effects) {
      const dem::EffectInfo* joined = dem::FindEffect(campaign.model.user_effects, other);
      if (joined != nullptr && dem::Exclude(*effect, *joined)) {
        return absl::StrCat(name, " is another law of what ", other,
                            " stands for: one of them, not both");
      }
    }
    model.effects.push_back(name);
  }
  if (!HasOwnEngine(campaign)) return "";
  if (const auto problems = dem::MaterialProblems(model); !problems.empty()) {
    return problems.front();  // the campaign's own model has none
  }
  const bool clumps =
      std::any_of(campaign.experiments.begin(), campaign.experiments.end(), HasClumps);
  const auto problems = dem::ShapeProblems(model, clumps);
  return problems.empty() ? "" : problems.front();
}

std::string WhyNotRun(const Campaign& campaign, std::span<const double> values) {
  if (values.size() != campaign.parameters.size()) {
    return absl::StrCat("a row has ", values.size(), " values, and the campaign has ",
                        campaign.parameters.size(), " parameters");
  }
  for (std::size_t j = 0; j < values.size(); ++j) {
    if (!std::isfinite(values[j])) {
      return absl::StrCat(campaign.parameters[j].name, " is not finite");
    }
  }
  const std::vector<std::string> active = ActiveEffects(campaign, values);
  for (std::size_t j = 0; j < values.size(); ++j) {
    const CalibratedParameter& parameter = campaign.parameters[j];
    const std::string effect = EffectNamedIn(parameter.name);
    const bool absent = IsOneOf(campaign.race, effect) && !IsOneOf(active, effect);
    if (absent || values[j] == NullOf(campaign, parameter.name)) continue;
    if (!parameter.prior.InSupport(values[j])) {
      return absl::StrCat(parameter.name, " = ", values[j], parameter.unit == "1" ? "" : " ",
                          parameter.unit == "1" ? "" : parameter.unit, " lies outside its prior");
    }
  }
  if (campaign.tied_prior &&
      !campaign.tied_prior->MeetsConstraints(Eigen::Map<const Eigen::VectorXd>(
          values.data(), static_cast<Eigen::Index>(values.size())))) {
    return "the values do not meet the constraints of the campaign";
  }
  return WhyNotTogether(campaign, active);
}

std::vector<double> MiddleValues(const Campaign& campaign, const std::vector<std::string>& with) {
  std::vector<double> values;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    const auto null = NullOf(campaign, parameter.name);
    const bool stays = null && !IsOneOf(with, EffectNamedIn(parameter.name));
    values.push_back(stays ? *null : parameter.prior.Quantile(0.5));
  }
  return values;
}

}  // namespace calib::campaign
