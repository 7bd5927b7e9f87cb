#include "server/campaign/file/parameters/setting_names.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/run_settings.h"

namespace calib::campaign {
namespace {

// A number of some experiments that a name may mean.
struct Meant {
  ExperimentNumber number;
  std::vector<std::string> experiments;
  bool fits = true;  // the same unit everywhere
};

std::string InWords(const Meant& meant) {
  return absl::StrCat(meant.number.name, " of ", Listed(meant.experiments));
}

void Narrow(const Range& other, Range& range) {
  if (other.min > range.min || (other.min == range.min && other.min_open)) {
    range.min = other.min;
    range.min_open = other.min_open;
  }
  if (other.max < range.max || (other.max == range.max && other.max_open)) {
    range.max = other.max;
    range.max_open = other.max_open;
  }
}

// The number of this name of all experiments that have it, or of those that state it.
std::optional<Meant> OfAll(const std::string& name,
                           const std::vector<ExperimentOutline>& outlines) {
  std::optional<Meant> meant;
  bool stated_only = false;
  for (const bool count : {true, false}) {  // first whether any states it
    for (const ExperimentOutline& outline : outlines) {
      for (const ExperimentNumber& number : NumbersOf(outline)) {
        if (number.name != name) continue;
        const bool stated = outline.stated.contains(name);
        if (count) {
          stated_only = stated_only || (number.optional && stated);
          continue;
        }
        if (stated_only && !stated) continue;
        if (!meant) {
          meant = Meant{.number = number, .experiments = {}};
        }
        meant->fits = meant->fits && meant->number.unit == number.unit;
        meant->number.whole = meant->number.whole || number.whole;
        Narrow(number.range, meant->number.range);
        meant->experiments.push_back(outline.name);
      }
    }
  }
  return meant;
}

std::vector<Meant> MeaningsOf(const std::string& name,
                              const std::vector<ExperimentOutline>& outlines) {
  std::vector<Meant> meanings;
  if (auto all = OfAll(name, outlines)) meanings.push_back(*std::move(all));
  for (const ExperimentOutline& outline : outlines) {
    const std::string prefix = outline.name + ".";
    if (outline.name.empty() || !absl::StartsWith(name, prefix)) continue;
    for (const ExperimentNumber& number : NumbersOf(outline)) {
      if (name == prefix + number.name) {
        meanings.push_back({.number = number, .experiments = {outline.name}});
      }
    }
  }
  return meanings;
}

// Unit of the number of any test by which a name ends; empty: there is none.
std::optional<std::string> UnitOfSome(const std::string& name) {
  const ExperimentNumber* longest = nullptr;
  static const std::vector<ExperimentNumber> all = NumbersOfAllTests();
  for (const ExperimentNumber& number : all) {
    const bool ends = name == number.name || absl::EndsWith(name, "." + number.name);
    if (ends && (longest == nullptr || number.name.size() > longest->name.size())) {
      longest = &number;
    }
  }
  if (longest != nullptr) return longest->unit;
  return absl::StrContains(name, kShareOfGrains) ? std::optional<std::string>("1") : std::nullopt;
}

const YamlNode* ExperimentsOf(const YamlNode& file) { return YamlFind(file, "experiments"); }

int LineOfParameter(const YamlNode& file, const std::string& name) {
  const YamlNode* parameters = YamlFind(file, "parameters");
  if (parameters == nullptr) return 0;
  for (const YamlEntry& entry : parameters->entries) {
    if (entry.key == name) return entry.line;
  }
  return 0;
}

void StateNumber(const SettingOf& setting, double value, int line, YamlNode& file) {
  if (setting.whole) value = std::round(value);
  for (YamlNode& experiment : YamlAt(file, "experiments").items) {
    const YamlNode* name =
        experiment.kind == YamlNode::Kind::kMap ? YamlFind(experiment, "name") : nullptr;
    if (name == nullptr || std::find(setting.experiments.begin(), setting.experiments.end(),
                                     name->scalar) == setting.experiments.end()) {
      continue;
    }
    StateInFile(setting.number, value, line, experiment);
  }
}

// Of each parameter that sets a number: its name, what it sets and the value in the middle.
struct NominalValue {
  std::string name;
  SettingOf setting;
  double value = 0;
};

std::vector<NominalValue> NominalValuesOf(const Campaign& campaign) {
  std::vector<NominalValue> all;
  const std::vector<double> middle = MiddleValues(campaign);
  for (std::size_t j = 0; j < middle.size(); ++j) {
    const CalibratedParameter& parameter = campaign.parameters[j];
    if (parameter.setting) all.push_back({parameter.name, *parameter.setting, middle[j]});
  }
  const std::vector<double> tied = TiedValues(campaign, middle);
  for (std::size_t k = 0; k < tied.size(); ++k) {
    const TiedParameter& one = campaign.tied[k];
    if (one.setting && std::isfinite(tied[k])) all.push_back({one.name, *one.setting, tied[k]});
  }
  return all;
}

// Numbers that say the same thing.
std::string WhatIsSet(const std::string& number) {
  if (number == "packing.void_ratio") return "packing.porosity";
  return number;
}

void AddModelParameters(const Campaign& campaign, std::vector<Calibratable>& all) {
  const dem::Model model = ModelWithRace(campaign);
  const auto add = [&](const std::string& name) {
    const dem::ParameterInfo* info = dem::FindParameter(model, name);
    if (info == nullptr) return;
    all.push_back({.name = name,
                   .unit = dem::UnitFor(*info, model.contact),
                   .meaning = info->description,
                   .experiments = {}});
  };
  if (const dem::ContactInfo* contact = dem::FindContact(model.contact)) {
    for (const dem::ParameterInfo& info : contact->parameters) add(info.name);
  }
  for (const std::string& name : model.effects) {
    const dem::EffectInfo* effect = dem::FindEffect(model.user_effects, name);
    if (effect == nullptr) continue;
    for (const dem::ParameterInfo& info : effect->parameters) {
      add(absl::StrCat(name, ".", info.name));
    }
  }
  for (const std::string& name : dem::MaterialParameters(model)) add(name);
}

}  // namespace

SettingNamed FindSetting(const std::string& name, const std::vector<ExperimentOutline>& outlines,
                         bool derived) {
  SettingNamed named;
  const std::vector<Meant> meanings = MeaningsOf(name, outlines);
  if (meanings.empty()) {
    const auto unit = derived ? UnitOfSome(name) : std::nullopt;
    if (unit) {
      named.setting = SettingOf{};
      named.unit = *unit;
    }
    return named;
  }
  const Meant& meant = meanings.front();
  if (meanings.size() > 1) {
    named.problem = absl::StrCat("has two meanings, ", InWords(meant), " and ",
                                 InWords(meanings[1]), "; call an experiment another");
    return named;
  }
  if (!meant.fits) {
    named.problem = absl::StrCat("is of different units in ", Listed(meant.experiments),
                                 "; name one: EXPERIMENT.", name);
    return named;
  }
  named.setting = SettingOf{.number = meant.number.name,
                            .experiments = meant.experiments,
                            .range = meant.number.range,
                            .whole = meant.number.whole};
  named.unit = meant.number.unit;
  named.meaning = absl::StrCat("the setting ", InWords(meant));
  return named;
}

std::vector<std::string> SettingNames(const std::vector<ExperimentOutline>& outlines) {
  std::vector<std::string> names;
  for (const bool of_one : {false, true}) {
    for (const ExperimentOutline& outline : outlines) {
      for (const ExperimentNumber& number : NumbersOf(outline)) {
        const std::string name =
            of_one ? absl::StrCat(outline.name, ".", number.name) : number.name;
        if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
      }
    }
  }
  return names;
}

std::vector<Calibratable> CalibratableIn(const std::string& yaml_text, const Campaign& campaign) {
  std::vector<Calibratable> all;
  if (campaign.precomputed) return all;
  AddModelParameters(campaign, all);
  const YamlParse parse = ParseYaml(yaml_text);
  if (parse.error || parse.root->kind != YamlNode::Kind::kMap) return all;
  for (const ExperimentOutline& outline : OutlinesOf(ExperimentsOf(*parse.root))) {
    if (outline.test == nullptr) continue;
    for (const ExperimentNumber& number : NumbersOf(outline)) {
      const auto known = std::find_if(all.begin(), all.end(), [&number](const Calibratable& one) {
        return one.name == number.name && one.unit == number.unit;
      });
      if (known != all.end()) {
        known->experiments.push_back(outline.name);
      } else {
        all.push_back({.name = number.name,
                       .unit = number.unit,
                       .meaning = number.meaning,
                       .experiments = {outline.name}});
      }
    }
  }
  return all;
}

void CheckExperimentNames(const std::vector<ExperimentOutline>& outlines, const Campaign& campaign,
                          ProblemList& problems) {
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const ExperimentOutline& outline = outlines[i];
    const std::string path = absl::StrCat("experiments[", i + 1, "].");
    const auto& groups = GroupsOfNumbers();
    const bool group = std::find(groups.begin(), groups.end(), outline.name) != groups.end();
    if (group || dem::FindEffect(campaign.model.user_effects, outline.name) != nullptr) {
      problems.Add(outline.line, path + "name",
                   absl::StrCat(Quoted(outline.name), " is what ",
                                group ? "a group of settings" : "an effect",
                                " is called, by which parameters are named; call the experiment "
                                "another"));
    }
    ExperimentOutline all = outline;
    all.as_stated.clear();
    const std::vector<ExperimentNumber> numbers = NumbersOf(all);
    std::vector<std::string> names;
    names.reserve(numbers.size());
    for (const ExperimentNumber& number : numbers) names.push_back(number.name);
    for (const std::string& name : outline.as_stated) {
      if (outline.test == nullptr || std::find(names.begin(), names.end(), name) != names.end())
        continue;
      problems.Add(outline.line, path + "as_stated",
                   absl::StrCat(Quoted(name), " is no setting of this experiment; ",
                                Suggestion(name, names)));
    }
  }
}

std::vector<SetTwice> NumbersSetTwice(const Campaign& campaign) {
  std::vector<SetTwice> found;
  std::map<std::pair<std::string, std::string>, std::string> set_by;  // experiment, number
  const auto look = [&](const std::string& name, const std::optional<SettingOf>& setting) {
    if (!setting) return;
    for (const std::string& experiment : setting->experiments) {
      const auto [place, added] =
          set_by.try_emplace({experiment, WhatIsSet(setting->number)}, name);
      if (added) continue;
      found.push_back({name, absl::StrCat("sets ", setting->number, " of ", experiment, ", as ",
                                          place->second, " does; keep one of them")});
      return;
    }
  };
  for (const CalibratedParameter& parameter : campaign.parameters) {
    look(parameter.name, parameter.setting);
  }
  for (const TiedParameter& tied : campaign.tied) look(tied.name, tied.setting);
  return found;
}

std::vector<std::string> ParameterNotes(const Campaign& campaign) {
  std::vector<std::string> notes;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    if (!parameter.setting || parameter.setting->experiments.empty()) continue;
    const SettingOf& setting = *parameter.setting;
    notes.push_back(absl::StrCat(
        parameter.name, " is the setting ", setting.number, " of ", Listed(setting.experiments),
        setting.whole ? "; a run takes the nearest whole number" : "",
        IsOfRecipe(setting.number) ? "; every sample has packings of its own, made before it runs"
                                   : "",
        "."));
  }
  for (const Population& population : campaign.populations) {
    notes.push_back(absl::StrCat(population.name, " has a value for each ",
                                 WordOf(kPerWords, population.per),
                                 " around a common one: ", Listed(population.labels), "."));
  }
  for (const TiedParameter& tied : campaign.tied) {
    notes.push_back(absl::StrCat(tied.name, " = ", tied.text, "."));
  }
  return notes;
}

void StateNominalValues(YamlNode& file, const Campaign& campaign) {
  const YamlNode* experiments = ExperimentsOf(file);
  if (experiments == nullptr || experiments->kind != YamlNode::Kind::kSequence) return;
  for (const NominalValue& nominal : NominalValuesOf(campaign)) {
    StateNumber(nominal.setting, nominal.value, LineOfParameter(file, nominal.name), file);
  }
}

void StateNominalDensity(const YamlNode& file, Campaign& campaign) {
  const YamlNode* model = YamlFind(file, "model");
  if (model != nullptr && YamlFind(*model, kDensityOfGrains) != nullptr) return;
  for (const NominalValue& nominal : NominalValuesOf(campaign)) {
    if (nominal.name == kDensityOfGrains) campaign.model.density = nominal.value;
  }
}

std::set<std::string> SettingsOfAll(const Campaign& campaign) {
  std::set<std::string> numbers;
  for (const NominalValue& nominal : NominalValuesOf(campaign)) {
    if (nominal.name == nominal.setting.number) numbers.insert(nominal.name);
  }
  return numbers;
}

std::vector<std::string> StatedBeside(const YamlNode& experiment, const Campaign& campaign) {
  const ExperimentOutline outline = OutlineOf(experiment);
  std::vector<std::string> stated;
  for (const ExperimentNumber& number : NumbersOf(outline)) {
    const auto same = [&number](const std::string& other) {
      return WhatIsSet(other) == WhatIsSet(number.name);
    };
    if (std::none_of(outline.stated.begin(), outline.stated.end(), same)) continue;
    for (const NominalValue& nominal : NominalValuesOf(campaign)) {
      if (!same(nominal.name) && nominal.name != outline.name + "." + number.name) continue;
      stated.push_back(number.name);
      break;
    }
  }
  return stated;
}

}  // namespace calib::campaign
