#include "server/campaign/file/read_model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "dem/model/model.h"
#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/parameters/tied_check.h"
#include "server/campaign/file/program/read_program.h"
#include "server/campaign/file/read_materials.h"
#include "server/campaign/file/read_population.h"
#include "server/campaign/file/shared/read_prior.h"
#include "server/campaign/file/shared/read_user_effects.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/range.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {
namespace {

// A parameter of the chosen model under its dotted name.
struct ModelParameter {
  std::string name;
  const dem::ParameterInfo* info;
  bool of_material = false;  // left out, it is as of the model's own material
};

std::vector<ModelParameter> ParametersOf(const dem::Model& model) {
  std::vector<ModelParameter> all;
  if (const dem::ContactInfo* contact = dem::FindContact(model.contact)) {
    for (const dem::ParameterInfo& info : contact->parameters) all.push_back({info.name, &info});
  }
  for (const std::string& name : model.effects) {
    const dem::EffectInfo* effect = dem::FindEffect(model.user_effects, name);
    if (effect == nullptr) continue;
    for (const dem::ParameterInfo& info : effect->parameters) {
      all.push_back({name + "." + info.name, &info});
    }
  }
  for (const std::string& name : dem::MaterialParameters(model)) {
    all.push_back({name, dem::FindParameter(model, name), true});
  }
  return all;
}

template <typename Entries>
std::vector<std::string> NamesOf(const Entries& entries) {
  std::vector<std::string> names;
  names.reserve(entries.size());
  for (const auto& entry : entries) names.push_back(entry.name);
  return names;
}

// The other names for the same quantity ("friction_coefficient" for "friction_angle"); a catalogue
// entry may name its alternative or be named by it.
std::vector<std::string> AlternativesOf(const ModelParameter& parameter,
                                        const std::vector<ModelParameter>& all) {
  const auto prefix = [](const std::string& name) { return name.substr(0, name.rfind('.') + 1); };
  std::vector<std::string> names;
  for (const ModelParameter& other : all) {
    const bool named = other.info->name == parameter.info->alternative_to ||
                       other.info->alternative_to == parameter.info->name;
    if (named && prefix(other.name) == prefix(parameter.name)) names.push_back(other.name);
  }
  return names;
}

// Whether an effect can act together with the contact, if that is known.
bool Joins(const dem::EffectInfo& effect, const std::string& contact) {
  return effect.contacts.empty() || contact.empty() ||
         std::find(effect.contacts.begin(), effect.contacts.end(), contact) !=
             effect.contacts.end();
}

std::string UnknownParameter(const std::string& name, const dem::Model& model,
                             const std::vector<ExperimentOutline>& experiments = {}) {
  std::string message = absl::StrCat("is not a parameter of ", model.contact,
                                     model.effects.empty() ? "" : " with " + Listed(model.effects));
  const std::size_t dot = name.find('.');
  const std::string effect = name.substr(0, dot);
  if (dot != std::string::npos && dem::FindEffect(model.user_effects, effect) != nullptr &&
      std::find(model.effects.begin(), model.effects.end(), effect) == model.effects.end()) {
    return absl::StrCat(message, "; add ", effect, " to model.effects to use it");
  }
  std::vector<std::string> names = NamesOf(ParametersOf(model));
  const std::vector<std::string> settings = SettingNames(experiments);
  if (!settings.empty() && Nearest(name, names).empty()) {
    absl::StrAppend(&message, " nor a setting of an experiment");
    const std::string meant = Nearest(name, settings);
    for (const std::string& setting : settings) {
      if (!meant.empty() ? setting == meant : !absl::StrContains(setting, '.')) {
        names.push_back(setting);
      }
    }
  }
  return absl::StrCat(message, "; ", Suggestion(name, names));
}

// An effect that cannot join the contact has been refused already, and asks for no values.
bool OfRefusedEffect(const std::string& parameter, const dem::Model& model) {
  const dem::EffectInfo* effect =
      dem::FindEffect(model.user_effects, parameter.substr(0, parameter.find('.')));
  return effect != nullptr && !Joins(*effect, model.contact);
}

// Of the effects that the model has, one that stands for the same thing as this one; empty: none.
std::string OtherLawOf(const dem::EffectInfo& effect, const dem::Model& model) {
  for (const std::string& name : model.effects) {
    const dem::EffectInfo* const other = dem::FindEffect(model.user_effects, name);
    if (other != nullptr && dem::Exclude(effect, *other)) return name;
  }
  return "";
}

void ReadEffects(MapReader& map, const ReadContext& context, dem::Model& model) {
  auto names = map.TextList("effects");
  if (!names) return;
  if (*names == std::vector<std::string>{"none"}) names->clear();
  for (const std::string& name : *names) {
    const dem::EffectInfo* effect = dem::FindEffect(model.user_effects, name);
    if (effect == nullptr) {
      std::vector<std::string> offered;
      for (const dem::EffectInfo* info : dem::AllEffects(model.user_effects)) {
        offered.push_back(info->name);
      }
      map.Problem("effects", absl::StrCat(Quoted(name), " is not an effect of this build; ",
                                          Suggestion(name, offered)));
      // With the effect that was probably meant its parameters are no further problems.
      if (const std::string meant = Nearest(name, offered); !meant.empty()) {
        model.effects.push_back(meant);
      }
    } else if (std::find(model.effects.begin(), model.effects.end(), name) != model.effects.end()) {
      map.Problem("effects", absl::StrCat(name, " is named twice"));
    } else if (!Joins(*effect, model.contact)) {
      map.Problem("effects", absl::StrCat(name, " cannot join the contact ", model.contact,
                                          "; it works with ", Listed(effect->contacts)));
      model.effects.push_back(name);  // so that its parameters are no further problems
    } else {
      const std::string other = context.is_new() ? OtherLawOf(*effect, model) : "";
      if (!other.empty()) {
        map.Problem("effects", absl::StrCat(name, " is another law of what ", other,
                                            " stands for: name one of them"));
      }
      model.effects.push_back(name);
    }
  }
}

// Of the parameter of a pair A-B the name that it has as one of B-A; empty: it is of no pair.
std::string InOtherOrder(const dem::Model& model, const std::string& name) {
  const std::string pair = name.substr(0, name.find('.'));
  if (!dem::IsMaterialPair(model, pair)) return "";
  const std::size_t dash = pair.find('-');
  if (pair.substr(0, dash) == pair.substr(dash + 1)) return "";
  return absl::StrCat(pair.substr(dash + 1), "-", pair.substr(0, dash), name.substr(pair.size()));
}

void ReadFixed(MapReader& map, dem::Model& model) {
  auto fixed = map.Map("fixed");
  if (!fixed) return;
  for (const std::string& name : fixed->Keys()) {
    const dem::ParameterInfo* info = dem::FindParameter(model, name);
    if (info == nullptr) {
      fixed->Ignore({name});
      if (!model.contact.empty()) fixed->Problem(name, UnknownParameter(name, model));
      continue;
    }
    const auto value =
        fixed->Quantity(name, dem::UnitFor(*info, model.contact), AdmissibleRange(*info));
    if (model.parameters.contains(name)) {
      fixed->Problem(name, "stands in model.materials or model.pairs already; keep one of them");
    }
    if (const std::string other = InOtherOrder(model, name); model.parameters.contains(other)) {
      fixed->Problem(name,
                     absl::StrCat("is ", other, ", which is given already; keep one of them"));
    }
    // A refused value still counts as given, so that one mistake is one problem.
    model.parameters[name] = value.value_or(std::nan(""));
  }
  fixed->Finish();
}

// Bounds of the prior against what is admissible; unbounded priors are cut off there.
void HoldToAdmissible(const Range& range, const std::string& unit, const std::string& key,
                      MapReader& parameters, inference::Prior& prior) {
  if (std::isinf(prior.min)) prior.min = range.min;
  if (std::isinf(prior.max)) prior.max = range.max;
  const bool normal =
      prior.kind == inference::PriorKind::kNormal || prior.kind == inference::PriorKind::kLogNormal;
  const bool low = prior.min < range.min || (range.min_open && prior.min <= range.min && !normal);
  const bool high = prior.max > range.max || (range.max_open && prior.max >= range.max && !normal);
  if (low || high) {
    parameters.Problem(key, absl::StrCat("the prior from ", prior.min, " to ", prior.max,
                                         " leaves what is admissible: ", range.Describe(unit)));
    return;
  }
  HoldsMass(prior, key, parameters);
}

// Of a program's effect the parameter with this dotted name; nullptr: there is none.
const dem::ParameterInfo* DeclaredParameter(const Campaign& campaign, const std::string& name) {
  if (!campaign.program) return nullptr;
  for (const dem::UserEffect& effect : campaign.model.user_effects) {
    for (const dem::ParameterInfo& own : effect.info.parameters) {
      if (absl::StrCat(effect.info.name, ".", own.name) == name) return &own;
    }
  }
  return nullptr;
}

// What the parameters may be of beside the model.
struct OtherSources {
  std::vector<ExperimentOutline> experiments;
  bool derived = false;  // from a campaign whose experiments may be no more
};

void AddCalibrated(CalibratedParameter parameter, const BesidePrior& beside,
                   const OtherSources& others, MapReader& parameters, Campaign& campaign) {
  parameter.nuisance = beside.nuisance;
  campaign.parameters.push_back(std::move(parameter));
  AddPopulation(beside, others.experiments, parameters, campaign);
}

// The prior of a setting, or what it is tied to.
void ReadSetting(MapReader& parameters, const SettingNamed& named, CalibratedParameter parameter,
                 const OtherSources& others, Campaign& campaign, std::vector<TieAsWritten>& ties) {
  const std::string& name = parameter.name;
  const YamlNode& node = *parameters.Find(name);
  const std::string path = parameters.PathOf(name);
  parameter.setting = named.setting;
  parameter.unit = named.unit;
  const Range& range = named.setting->range;
  if (IsTied(node)) {
    ties.push_back({.name = name,
                    .unit = parameter.unit,
                    .range = range,
                    .text = ReadTie(node, path, parameters.problems()).value_or(""),
                    .setting = parameter.setting});
    return;
  }
  BesidePrior beside;
  if (const auto prior = ReadPriorOf(node, path, parameter.unit, parameters.problems(), beside)) {
    parameter.prior = *prior;
    HoldToAdmissible(range, parameter.unit, name, parameters, parameter.prior);
  }
  AddCalibrated(std::move(parameter), beside, others, parameters, campaign);
}

// A parameter of a program is whatever its prior says.
void ReadProgramParameter(MapReader& parameters, CalibratedParameter parameter,
                          const OtherSources& others, Campaign& campaign,
                          std::vector<TieAsWritten>& ties) {
  const std::string name = parameter.name;
  const YamlNode& node = *parameters.Find(name);
  const std::string path = parameters.PathOf(name);
  const dem::ParameterInfo* declared = DeclaredParameter(campaign, name);
  if (IsTied(node)) {
    ties.push_back({.name = name,
                    .unit = declared != nullptr ? declared->unit : "",
                    .range = {},
                    .text = ReadTie(node, path, parameters.problems()).value_or(""),
                    .setting = std::nullopt});
    return;
  }
  // What an effect's declaration says of its unit holds where these numbers have none.
  const bool as_declared = declared != nullptr && UnitOfPrior(node) == "1";
  if (as_declared) parameter.unit = declared->unit;
  BesidePrior beside;
  const auto prior = as_declared
                         ? ReadPriorOf(node, path, parameter.unit, parameters.problems(), beside)
                         : ReadFreePrior(node, path, parameters.problems(), parameter.unit, beside);
  if (prior) parameter.prior = *prior;
  AddCalibrated(std::move(parameter), beside, others, parameters, campaign);
}

void ReadOne(MapReader& parameters, const std::string& name, const OtherSources& others,
             Campaign& campaign, std::vector<TieAsWritten>& ties) {
  const YamlNode& node = *parameters.Find(name);
  const std::string path = parameters.PathOf(name);
  CalibratedParameter parameter{.name = name, .unit = "", .prior = {}};
  if (campaign.precomputed && IsTied(node)) {
    parameters.Problem(name, "cannot be tied: runs made elsewhere have a value of each parameter");
    return;
  }
  if (campaign.program) {
    ReadProgramParameter(parameters, std::move(parameter), others, campaign, ties);
    return;
  }
  if (campaign.precomputed) {
    BesidePrior beside;
    if (const auto prior =
            ReadFreePrior(node, path, parameters.problems(), parameter.unit, beside)) {
      parameter.prior = *prior;
    }
    if (beside.per) {
      parameters.Problem(name,
                         "cannot differ between experiments: runs made elsewhere have one value of "
                         "each parameter; leave per out");
    }
    parameter.nuisance = beside.nuisance;
    campaign.parameters.push_back(parameter);
    return;
  }
  const dem::Model model = ModelWithRace(campaign);
  const bool is_design = RunsAreAdded(campaign);
  const dem::ParameterInfo* info = is_design ? FindNumerics(name) : nullptr;
  if (info == nullptr) info = dem::FindParameter(model, name);
  SettingNamed named = FindSetting(name, others.experiments, info == nullptr && others.derived);
  if (info != nullptr && named.setting) {
    named.problem = absl::StrCat("has two meanings, the parameter of the model and ", named.meaning,
                                 "; the setting of one is called EXPERIMENT.", name);
  }
  if (!named.problem.empty()) {
    parameters.Problem(name, named.problem);
    return;
  }
  if (named.setting) {
    ReadSetting(parameters, named, std::move(parameter), others, campaign, ties);
    return;
  }
  if (info == nullptr) {
    if (!model.contact.empty()) {
      parameters.Problem(name, UnknownParameter(name, model, others.experiments));
    }
    return;
  }
  parameter.unit = dem::UnitFor(*info, campaign.model.contact);
  if (IsTied(node)) {
    ties.push_back({.name = name,
                    .unit = parameter.unit,
                    .range = AdmissibleRange(*info),
                    .text = ReadTie(node, path, parameters.problems()).value_or("")});
    return;
  }
  BesidePrior beside;
  if (node.kind == YamlNode::Kind::kScalar && node.scalar == "default") {
    parameter.prior.kind = info->default_prior.kind == "log_uniform"
                               ? inference::PriorKind::kLogUniform
                               : inference::PriorKind::kUniform;
    parameter.prior.min = info->default_prior.min;
    parameter.prior.max = info->default_prior.max;
  } else if (const auto prior =
                 ReadPriorOf(node, path, parameter.unit, parameters.problems(), beside)) {
    parameter.prior = *prior;
    HoldToAdmissible(AdmissibleRange(*info), parameter.unit, name, parameters, parameter.prior);
  }
  AddCalibrated(std::move(parameter), beside, others, parameters, campaign);
}

void CheckSources(const MapReader& campaign_map, const Campaign& campaign,
                  const std::vector<TieAsWritten>& ties) {
  const dem::Model model = ModelWithRace(campaign);
  const auto calibrated = [&](const std::string& name) {
    const auto is_it = [&name](const auto& p) { return p.name == name; };
    return std::any_of(campaign.parameters.begin(), campaign.parameters.end(), is_it) ||
           std::any_of(ties.begin(), ties.end(), is_it);
  };
  const auto fixed = [&](const std::string& name) {
    return model.parameters.contains(name) || model.parameters.contains(InOtherOrder(model, name));
  };
  const auto given = [&](const std::string& name) {
    return calibrated(name) || calibrated(InOtherOrder(model, name)) || fixed(name);
  };
  for (const CalibratedParameter& parameter : campaign.parameters) {
    const std::string& name = parameter.name;
    if (model.parameters.contains(name)) {
      campaign_map.Problem("parameters", name + " is both calibrated and fixed; keep one of them");
    }
    const std::string other = InOtherOrder(model, name);
    // Of two that are both calibrated the first in the alphabet speaks.
    if (model.parameters.contains(other) || (name < other && calibrated(other))) {
      campaign_map.Problem("parameters",
                           absl::StrCat(name, " and ", other, " are the same; give one of them"));
    }
  }
  const std::vector<ModelParameter> all = ParametersOf(model);
  std::vector<std::string> said;  // names dealt with as the alternative of an earlier one
  for (const ModelParameter& parameter : all) {
    if (std::find(said.begin(), said.end(), parameter.name) != said.end()) continue;
    bool covered = given(parameter.name) || parameter.info->default_value ||
                   parameter.of_material || OfRefusedEffect(parameter.name, model);
    std::string or_others;
    for (const std::string& other : AlternativesOf(parameter, all)) {
      said.push_back(other);
      or_others += " (or " + other + ")";
      // Two values of a material that are both fixed have been refused with the materials.
      const bool refused = parameter.of_material && fixed(parameter.name) && fixed(other);
      if (given(parameter.name) && given(other) && !refused) {
        campaign_map.Problem("parameters", absl::StrCat(parameter.name, " and ", other,
                                                        " say the same thing; give one of them"));
      }
      covered = covered || given(other);
    }
    if (!covered) {
      campaign_map.Problem(
          "parameters", absl::StrCat(parameter.name, or_others,
                                     " has no value; calibrate it here or set it in model.fixed"));
    }
  }
}

// Keys that only a program's model has.
constexpr std::array kProgramKeys = {"command",    "files",    "templates",  "keep",
                                     "checkpoint", "states",   "persistent", "limits",
                                     "version",    "numerics", "next"};

SayOfTied SayAt(const MapReader& parameters) {
  return [&parameters](const std::string& name, const std::string& message) {
    parameters.Problem(name, message);
  };
}

}  // namespace

void ReadModel(MapReader& campaign_map, ReadContext& context, Campaign& campaign) {
  const YamlNode* node =
      campaign_map.Require("model", "it names contact, effects, density and fixed parameters");
  if (node == nullptr) return;
  MapReader map(*node, campaign_map.PathOf("model"), SectionOf("model"), campaign_map.problems());
  if (NamesProgram(map)) {
    ReadProgram(map, context, campaign);
    return;
  }
  for (const char* key : kProgramKeys) {
    map.Ignore({key});
    if (map.Has(key)) map.Problem(key, "is of a program as the model; command is missing");
  }
  if (map.Has("precomputed")) {
    map.Ignore({"precomputed", "contact", "effects", "user_effects", "density", "materials",
                "pairs", "fixed", "shear_unloading"});  // read with the experiments
    if (map.Has("user_effects")) {
      map.Problem("user_effects",
                  "acts on runs of this program's DEM; runs made elsewhere (precomputed) cannot be "
                  "made with it: leave it out");
    }
    campaign.precomputed.emplace();
    map.Finish();
    return;
  }
  map.Ignore({"precomputed"});
  dem::Model& model = campaign.model;
  if (map.Require("contact", "one of " + Listed(map.WordsOf("contact"))) != nullptr) {
    model.contact = map.Choice("contact").value_or("");
  }
  model.shear_unloading =
      map.Choice("shear_unloading", kShearUnloadingWords).value_or(model.shear_unloading);
  ReadUserEffects(map, context, model);
  ReadEffects(map, context, model);
  model.density = map.Quantity("density").value_or(model.density);
  ReadMaterials(map, model);
  ReadFixed(map, model);
  map.Finish();
}

void ReadParameters(MapReader& campaign_map, bool is_new, Campaign& campaign) {
  if (campaign_map.Require("parameters", "it names what is calibrated, each with its prior") ==
      nullptr) {
    return;
  }
  auto parameters = campaign_map.Map("parameters");
  if (!parameters) return;
  if (parameters->Keys().empty()) {
    campaign_map.Problem("parameters", "is empty; at least one parameter has to be calibrated");
  }
  const std::size_t before = campaign_map.problems().size();
  OtherSources others;
  if (!campaign.precomputed) {
    others = {.experiments = OutlinesOf(campaign_map.Find("experiments")),
              .derived = campaign_map.Has("lineage")};
  }
  if (!campaign.model.contact.empty()) {  // of runs that this program's DEM makes
    if (is_new) CheckExperimentNames(others.experiments, campaign, campaign_map.problems());
  }
  std::vector<std::string> seen;
  std::vector<TieAsWritten> ties;
  for (const std::string& name : parameters->Keys()) {
    if (std::find(seen.begin(), seen.end(), name) != seen.end()) {
      continue;  // Finish() reports doubles
    }
    seen.push_back(name);
    ReadOne(*parameters, name, others, campaign, ties);
  }
  parameters->Finish();
  if (!campaign.precomputed && !campaign.program && !campaign.model.contact.empty()) {
    CheckSources(campaign_map, campaign, ties);
  }
  if (campaign_map.problems().size() > before) return;
  if (!ties.empty() && campaign.parameters.empty()) {
    campaign_map.Problem("parameters", "are all tied; at least one has to be calibrated");
    return;
  }
  TieParameters(ties, campaign, SayAt(*parameters));
  for (const SetTwice& twice : NumbersSetTwice(campaign)) {
    parameters->Problem(twice.name, twice.problem);
  }
}

void CheckTied(MapReader& campaign_map, const Campaign& campaign) {
  if (campaign.tied.empty()) return;
  const auto parameters = campaign_map.Map("parameters");
  CheckTiedValues(campaign, SayAt(*parameters));
}

}  // namespace calib::campaign
