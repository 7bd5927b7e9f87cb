#include "server/campaign/file/shared/read_user_effects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/formula/formula.h"
#include "dem/formula/user_effect.h"
#include "dem/registry/declared_effects.h"
#include "inference/prior/prior.h"
#include "server/campaign/file/shared/formula_units.h"
#include "server/campaign/file/shared/read_prior.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Where on the prior of a strength it is tried, without `steps`.
constexpr double kNearQuantile = 0.5;
constexpr double kFarQuantile = 0.8;

Dimension DimensionOf(const std::string& unit) {
  const auto parsed = ParseUnit(unit);
  return parsed.ok() ? parsed->dimension : Dimension{};
}

std::vector<std::string> NamesOf(std::span<const dem::FormulaQuantity> quantities) {
  std::vector<std::string> names;
  for (const dem::FormulaQuantity& q : quantities) names.push_back(q.name);
  return names;
}

// The prior of a parameter; only the two kinds that every effect may have.
std::optional<inference::Prior> ReadDefaultPrior(MapReader& map, dem::ParameterInfo& info) {
  const YamlNode* node = map.Find("prior");
  if (node == nullptr) return std::nullopt;
  const auto prior = ReadPrior(*node, map.PathOf("prior"), info.unit, map.problems());
  if (!prior) return std::nullopt;
  const bool log = prior->kind == inference::PriorKind::kLogUniform;
  if (!log && prior->kind != inference::PriorKind::kUniform) {
    map.Problem("prior", "has to be uniform or log_uniform; others go into parameters");
    return std::nullopt;
  }
  info.default_prior = {
      .kind = log ? "log_uniform" : "uniform", .min = prior->min, .max = prior->max};
  return prior;
}

// Two values of the parameter as distances from its null, the nearer first.
std::optional<dem::StrengthRay> ReadRay(MapReader& map, const dem::ParameterInfo& info,
                                        const inference::Prior& prior, bool both, bool is_new) {
  const double null = *info.null_value;
  std::vector<double> values;
  if (const auto texts = map.TextList("steps")) {
    for (const std::string& text : *texts) {
      const auto value = ParseQuantity(text, info.unit);
      if (!value.ok()) {
        map.Problem("steps", std::string(value.status().message()));
        return std::nullopt;
      }
      values.push_back(*value);
    }
    if (values.size() != 2 || values[0] == values[1] || values[0] == null || values[1] == null) {
      map.Problem("steps", absl::StrCat("needs two different values of ", info.name,
                                        ", neither of them its null: moderate strengths to try"));
      return std::nullopt;
    }
  } else {
    // Beyond the null on the wider side of a prior that reaches both ways.
    const bool up = prior.max - null >= null - prior.min;
    const auto at = [&](double share) {
      const double p = both ? 0.5 + 0.5 * share : share;
      return prior.Quantile(up ? p : 1 - p);
    };
    values = {at(kNearQuantile), at(kFarQuantile)};
  }
  for (const double value : values) {
    if (value < info.min || value > info.max) {
      map.Problem("steps", absl::StrCat(value, " is outside what its sign allows"));
      return std::nullopt;
    }
    if (is_new && (value < prior.min || value > prior.max)) {
      map.Problem("steps", absl::StrCat(value, " is outside its prior, ", prior.min, " to ",
                                        prior.max, ": a fit could not take that strength"));
      return std::nullopt;
    }
  }
  std::sort(values.begin(), values.end(),
            [null](double a, double b) { return std::abs(a - null) < std::abs(b - null); });
  return dem::StrengthRay{.parameter = info.name, .steps = {values[0] - null, values[1] - null}};
}

// What a strength is tried with: the median of the prior of every parameter that is no strength and
// has no default.
std::map<std::string, double> MediansOfOthers(const std::vector<dem::ParameterInfo>& parameters) {
  std::map<std::string, double> medians;
  for (const dem::ParameterInfo& p : parameters) {
    if (p.null_value || p.default_value) continue;
    const dem::DefaultPrior& prior = p.default_prior;
    medians[p.name] = prior.kind == "log_uniform" ? std::sqrt(prior.min * prior.max)
                                                  : (prior.min + prior.max) / 2;
  }
  return medians;
}

void ReadParameter(MapReader& map, const std::string& name, bool is_new, dem::EffectInfo& effect) {
  const std::size_t before = map.problems().size();
  dem::ParameterInfo info;
  info.name = name;
  info.unit = "1";
  info.min = -kInfinite;
  info.max = kInfinite;
  if (const auto unit = map.Text("unit")) {
    const auto parsed = ParseUnit(*unit);
    if (!parsed.ok()) {
      map.Problem("unit", std::string(parsed.status().message()));
    } else {
      info.unit = parsed->factor == 1 ? *unit : SiName(parsed->dimension);
    }
  }
  if (const YamlNode* prior = map.Find("prior"); prior != nullptr && !map.Has("unit")) {
    info.unit = UnitOfPrior(*prior);
  }
  info.null_value = map.Quantity("null", info.unit, {});
  info.default_value = map.Quantity("default", info.unit, {});
  info.description = map.Text("description").value_or("");
  const auto prior = ReadDefaultPrior(map, info);
  bool both = false;
  if (info.null_value) {
    const double null = *info.null_value;
    Sign sign = Sign::kEither;
    if (prior && prior->min >= null) sign = Sign::kPlus;
    if (prior && prior->max <= null) sign = Sign::kMinus;
    sign = map.Choice("sign", kSignWords).value_or(sign);
    if (sign == Sign::kPlus) info.min = null;
    if (sign == Sign::kMinus) info.max = null;
    both = sign == Sign::kEither;
    if (prior && (prior->min < info.min || prior->max > info.max)) {
      map.Problem("prior", absl::StrCat("reaches beyond the null ", null, ", but its sign is ",
                                        WordOf(kSignWords, sign)));
    }
    if (!prior && !map.Has("prior")) {
      map.Problem("prior",
                  "is missing; a strength needs the range in which to look for it, e.g. {prior: "
                  "uniform, min: 0, max: 1}");
    }
  } else {
    map.Ignore({"sign"});
    if (!prior && !info.default_value && !map.Has("prior")) {
      map.Problem("default", "is missing; a parameter without null needs a default or a prior");
    }
  }
  if (prior && info.null_value && map.problems().size() == before) {
    if (const auto ray = ReadRay(map, info, *prior, both, is_new)) {
      effect.rays.push_back(*ray);
      effect.two_sided = effect.two_sided || both;
    }
  } else {
    map.Ignore({"steps"});
  }
  map.Finish();
  effect.parameters.push_back(std::move(info));
}

void ReadTarget(MapReader& map, dem::UserEffect& effect) {
  std::vector<std::string> targets = NamesOf(dem::ContactTargets());
  for (const std::string& name : NamesOf(dem::ReadingTargets())) targets.push_back(name);
  const auto adds = map.Text("adds");
  const auto scales = map.Text("scales");
  if (adds.has_value() == scales.has_value()) {
    map.Problem("adds",
                "needs exactly one of adds and scales: what the formula changes, e.g. adds: "
                "normal_force");
    return;
  }
  effect.action = adds ? dem::FormulaAction::kAdds : dem::FormulaAction::kScales;
  effect.target = adds ? *adds : *scales;
  effect.info.kind = dem::KindOfTarget(effect.target);
  if (std::find(targets.begin(), targets.end(), effect.target) == targets.end()) {
    map.Problem(adds ? "adds" : "scales",
                absl::StrCat(Quoted(effect.target), " cannot be changed by a formula; ",
                             Suggestion(effect.target, targets)));
    effect.target.clear();
  }
}

std::string UnitOfTarget(const dem::UserEffect& effect) {
  if (effect.action == dem::FormulaAction::kScales) return "1";
  for (const auto& list : {dem::ContactTargets(), dem::ReadingTargets()}) {
    for (const dem::FormulaQuantity& q : list) {
      if (q.name == effect.target) return q.unit;
    }
  }
  return "1";
}

// Syntax, names and units, each with the place in the formula.
bool UnitsAreSound(const MapReader& map, const dem::UserEffect& effect) {
  std::map<std::string, Dimension> names;
  for (const dem::FormulaQuantity& q : dem::QuantitiesOf(effect.info.kind)) {
    names[q.name] = DimensionOf(q.unit);
  }
  for (const dem::ParameterInfo& p : effect.info.parameters) names[p.name] = DimensionOf(p.unit);
  const FormulaUnits units = UnitsOf(effect.formula, names);
  if (!units.problem.empty()) {
    map.Problem("formula", absl::StrCat("character ", units.position, ": ", units.problem));
    return false;
  }
  const std::string wanted = UnitOfTarget(effect);
  if (!units.anything && !SameKind(units.dimension, DimensionOf(wanted))) {
    map.Problem("formula",
                absl::StrCat("gives ", KindOfUnit(SiName(units.dimension)), ", but what it ",
                             effect.action == dem::FormulaAction::kScales ? "scales " : "adds to ",
                             effect.target, " has to be ", KindOfUnit(wanted)));
    return false;
  }
  return true;
}

std::string Describe(const dem::UserEffect& effect, const std::string& own) {
  const bool scales = effect.action == dem::FormulaAction::kScales;
  return absl::StrCat(own, own.empty() ? "" : "; ", scales ? "scales " : "adds to ", effect.target,
                      ": ", effect.formula, effect.info.two_sided ? "; two-sided" : "; one-sided");
}

// With problems the effect is what could be read of it, so that its names cause no further ones.
dem::UserEffect ReadOne(MapReader& map, const std::string& name, bool is_new) {
  const std::size_t before = map.problems().size();
  dem::UserEffect effect;
  effect.info.name = name;
  ReadTarget(map, effect);
  effect.formula = map.RequiredText("formula", "the expression of the effect").value_or("");
  if (const auto unit = map.Text("unit")) {
    const auto parsed = ParseUnit(*unit);
    const std::string wanted = UnitOfTarget(effect);
    if (!parsed.ok()) {
      map.Problem("unit", std::string(parsed.status().message()));
    } else if (!effect.target.empty() &&
               (parsed->factor != 1 || !SameKind(parsed->dimension, DimensionOf(wanted)))) {
      map.Problem("unit", absl::StrCat("is ", *unit, ", but the formula has to give ",
                                       wanted == "1" ? "a plain number" : wanted));
    }
  }
  ReadEffectParameters(map, is_new, effect.info);
  effect.info.contacts = map.TextList("contacts").value_or(std::vector<std::string>{});
  for (const std::string& contact : effect.info.contacts) {
    if (dem::FindContact(contact) == nullptr) {
      map.Problem("contacts", absl::StrCat(Quoted(contact), " is no contact of this build"));
    }
  }
  effect.info.excited_by = map.TextList("tests").value_or(std::vector<std::string>{});
  for (const std::string& test : effect.info.excited_by) {
    if (dem::FindTest(test) == nullptr) {
      map.Problem("tests", absl::StrCat(Quoted(test), " is no test of this build"));
    }
  }
  effect.info.reference = map.Text("source").value_or("written in the campaign file");
  effect.info.description = Describe(effect, map.Text("description").value_or(""));
  map.Finish();
  if (map.problems().size() > before) return effect;
  if (!UnitsAreSound(map, effect)) return effect;
  const auto problems = dem::UserEffectProblems(effect);
  for (const std::string& problem : problems) map.Problem("formula", problem);
  if (!problems.empty()) return effect;
  if (const std::string problem = dem::NullProblem(effect); !problem.empty()) {
    map.Problem("formula", problem);
    return effect;
  }
  effect.info.needs_motion = dem::IsViscous(effect);
  const dem::Formula formula(effect.formula, dem::FormulaNames(effect));
  const auto first = static_cast<int>(dem::QuantitiesOf(effect.info.kind).size());
  for (std::size_t p = 0; p < effect.info.parameters.size(); ++p) {
    const auto& used = formula.used();
    if (std::find(used.begin(), used.end(), first + static_cast<int>(p)) == used.end()) {
      map.Problem("parameters", effect.info.parameters[p].name + " does not occur in the formula");
    }
  }
  return effect;
}

}  // namespace

void ReadEffectParameters(MapReader& map, bool is_new, dem::EffectInfo& effect) {
  const std::size_t before = map.problems().size();
  auto parameters = map.Map("parameters");
  if (!parameters) {
    if (!map.Has("parameters")) {
      map.Problem("parameters",
                  "is missing; at least one, with its null, is the effect's strength");
    }
    return;
  }
  const std::string prefix = effect.name + ".";
  for (const std::string& key : parameters->Keys()) {
    const std::string name = key.starts_with(prefix) ? key.substr(prefix.size()) : key;
    if (auto parameter = parameters->Map(key)) ReadParameter(*parameter, name, is_new, effect);
  }
  parameters->Finish();
  if (map.problems().size() > before) return;
  const auto strengths =
      std::count_if(effect.parameters.begin(), effect.parameters.end(),
                    [](const dem::ParameterInfo& p) { return p.null_value.has_value(); });
  if (strengths == 0) {
    map.Problem("parameters",
                "none has a null; one at least has to be the effect's strength, with the value at "
                "which the effect vanishes");
    return;
  }
  for (dem::ParameterInfo& p : effect.parameters) {  // several strengths: each may stay away
    if (strengths > 1 && p.null_value && !p.default_value) p.default_value = p.null_value;
  }
  for (dem::StrengthRay& ray : effect.rays) ray.held = MediansOfOthers(effect.parameters);
}

void ReadUserEffects(MapReader& model_map, const ReadContext& context, dem::Model& model) {
  auto effects = model_map.Map("user_effects");
  if (!effects) return;
  std::vector<std::string> seen;
  for (const std::string& name : effects->Keys()) {
    if (std::find(seen.begin(), seen.end(), name) != seen.end()) continue;  // Finish() says so
    seen.push_back(name);
    auto one = effects->Map(name);
    if (!one) continue;
    model.user_effects.push_back(ReadOne(*one, name, context.is_new()));
  }
  effects->Finish();
}

void ReadHeldEffects(MapReader& map, bool is_new, const std::string& reference, dem::Model& model) {
  auto effects = map.Map("effects");
  if (!effects) return;
  const std::vector<std::string> names = effects->Keys();
  for (const std::string& name : names) {
    auto one = effects->Map(name);
    if (!one) continue;
    dem::UserEffect effect;
    effect.info.name = name;
    effect.info.kind = "held";  // by the runs, and unknown to the engine
    effect.info.reference = reference;
    effect.info.description = one->Text("description").value_or("");
    if (name.find('.') != std::string::npos) {
      effects->Problem(name, "an effect's name has no dot: what stands behind it is a parameter");
    } else if (dem::FindEffect(name) != nullptr) {
      effects->Problem(name, "is an effect of this build; call that of your runs another");
    }
    ReadEffectParameters(*one, is_new, effect.info);
    effect.info.excludes = one->TextList("excludes").value_or(std::vector<std::string>{});
    for (const std::string& other : effect.info.excludes) {
      if (other == name || std::find(names.begin(), names.end(), other) == names.end()) {
        one->Problem("excludes", absl::StrCat(Quoted(other), " is none of the others; ",
                                              Suggestion(other, names)));
      }
    }
    if (one->TrueOrFalse("acts").value_or(false)) model.effects.push_back(name);
    one->Finish();
    model.user_effects.push_back(std::move(effect));
  }
  effects->Finish();
}

std::vector<std::string> NotCalibratedOfActing(const Campaign& campaign) {
  std::vector<std::string> missing;
  for (const std::string& effect : campaign.model.effects) {
    const dem::EffectInfo* info = dem::FindEffect(campaign.model.user_effects, effect);
    if (info == nullptr) continue;
    for (const dem::ParameterInfo& own : info->parameters) {
      const std::string dotted = absl::StrCat(effect, ".", own.name);
      const bool calibrated = std::any_of(
          campaign.parameters.begin(), campaign.parameters.end(),
          [&dotted](const CalibratedParameter& parameter) { return parameter.name == dotted; });
      if (calibrated || own.default_value || FindTied(campaign, dotted) != nullptr) continue;
      missing.push_back(absl::StrCat(dotted, ", of the effect ", effect, " that acts,"));
    }
  }
  return missing;
}

}  // namespace calib::campaign
