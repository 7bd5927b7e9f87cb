#include "server/diagnosis/race_list.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/model/excitation.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/reading_effects.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

constexpr const char* kNotCalculated = "the runs were made elsewhere, none can be made with it";
constexpr const char* kNotDeclared = "model.effects of the program has no such effect";

bool IsAmong(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

const dem::ParameterInfo* ParameterNamed(const dem::EffectInfo& effect, const std::string& name) {
  for (const dem::ParameterInfo& parameter : effect.parameters) {
    if (parameter.name == name) return &parameter;
  }
  return nullptr;
}

// The prior as the inference takes it; only the kinds of a dem::DefaultPrior.
inference::Prior PriorFrom(const dem::DefaultPrior& prior) {
  return {.kind = prior.kind == "log_uniform" ? inference::PriorKind::kLogUniform
                                              : inference::PriorKind::kUniform,
          .min = prior.min,
          .max = prior.max};
}

// Rays that are strengths of their own: not those of a parameter that another, earlier ray holds
// away from its null, which shapes that one.
std::vector<const dem::StrengthRay*> StrengthRays(const dem::EffectInfo& effect) {
  std::vector<const dem::StrengthRay*> rays;
  for (const dem::StrengthRay& ray : effect.rays) {
    const bool held = std::any_of(rays.begin(), rays.end(), [&ray](const auto* earlier) {
      return earlier->held.count(ray.parameter) > 0;
    });
    if (!held) rays.push_back(&ray);
  }
  return rays;
}

// How far an entry may go to either side of its null.
void SetEnds(const dem::ParameterInfo& parameter, const dem::DefaultPrior& prior,
             RacingEffect& entry) {
  const double up = std::max(0.0, std::min(prior.max, parameter.max) - entry.null);
  const double down = std::max(0.0, entry.null - std::max(prior.min, parameter.min));
  const bool up_ends = parameter.max <= prior.max;
  const bool down_ends = parameter.min >= prior.min;
  const bool forward = entry.near > 0;
  entry.most = forward ? up : down;
  entry.ends = forward ? up_ends : down_ends;
  entry.most_other = forward ? down : up;
  entry.other_ends = forward ? down_ends : up_ends;
  if (!entry.design.two_sided) entry.most_other = 0;
}

std::vector<RacingEffect> EntriesOf(const report::CampaignView& view,
                                    const dem::EffectInfo& effect) {
  const std::string& contact = view.campaign.model.contact;
  const dem::ReferenceState state = ReferenceOf(view);
  const std::map<std::string, dem::DefaultPrior> priors = PriorsOfExtension(view, effect);
  std::vector<RacingEffect> entries;
  std::set<std::string> strengths;
  for (const dem::StrengthRay* ray : StrengthRays(effect)) {
    const dem::ParameterInfo* parameter = ParameterNamed(effect, ray->parameter);
    RacingEffect entry{.name = effect.name,
                       .family = effect.family,
                       .strength = absl::StrCat(effect.name, ".", ray->parameter)};
    const auto prior = priors.find(entry.strength);
    if (parameter == nullptr || prior == priors.end()) continue;
    entry.null = *dem::NullValueOf(*parameter, contact);
    const auto distance = [&](double step) {
      return dem::ParametersOnRay(effect, *ray, step, contact, state).at(entry.strength) -
             entry.null;
    };
    entry.near = distance(ray->steps[0]);
    entry.far = distance(ray->steps[1]);
    entry.design = {.power = ray->order, .two_sided = effect.two_sided};
    SetEnds(*parameter, prior->second, entry);
    // Where the nearer step is not to be had to one side, that side is none.
    if (entry.most_other < std::abs(entry.near)) entry.most_other = 0;
    if (entry.most < std::abs(entry.near)) {
      std::swap(entry.most, entry.most_other);
      std::swap(entry.ends, entry.other_ends);
      entry.near = -entry.near;
      entry.far = -entry.far;
    }
    if (entry.most < std::abs(entry.near)) continue;
    if (entry.most_other < std::abs(entry.near)) entry.most_other = 0;
    entry.design.two_sided = entry.most_other > 0;
    strengths.insert(entry.strength);
    entries.push_back(std::move(entry));
  }
  for (const auto& [name, prior] : priors) {
    if (strengths.count(name) > 0) continue;
    const dem::ParameterInfo* parameter = ParameterNamed(effect, name.substr(name.rfind('.') + 1));
    if (parameter == nullptr || entries.empty()) continue;
    ShapeParameter shape{.name = name, .prior = PriorFrom(prior), .whole = parameter->whole};
    shape.absent = dem::NullValueOf(*parameter, contact).value_or(shape.prior.Quantile(0.5));
    entries.front().shapes.push_back(std::move(shape));
  }
  for (RacingEffect& entry : entries) entry.design.shapes = static_cast<int>(entry.shapes.size());
  return entries;
}

// Those of an effect's entries that are calculated on curves, shapes held as they are there.
std::vector<RacingEffect> EntriesOnCurves(const report::CampaignView& view,
                                          const dem::EffectInfo& effect,
                                          const EffectsOnCurves& curves) {
  std::vector<RacingEffect> entries = EntriesOf(view, effect);
  std::erase_if(entries, [&curves](const RacingEffect& entry) {
    return curves.by_strength.count(entry.strength) == 0;
  });
  for (RacingEffect& entry : entries) {
    entry.shapes.clear();
    entry.design.shapes = 0;
  }
  return entries;
}

// Whether rows of the campaign's tables, or runs of its program, have the effect.
bool IsHeld(const campaign::Campaign& campaign, const std::string& effect) {
  const auto& declared = campaign.model.user_effects;
  return std::any_of(declared.begin(), declared.end(),
                     [&effect](const dem::UserEffect& own) { return own.info.name == effect; });
}

// Why an effect cannot be calculated on curves, in a clause; empty: it can.
std::string WhyNotCalculated(const campaign::Campaign& campaign, const EffectsOnCurves& curves,
                             const std::string& effect) {
  for (const auto& [name, why] : curves.impossible) {
    if (name == effect) return why;
  }
  const std::string prefix = effect + ".";
  const auto first = curves.by_strength.lower_bound(prefix);
  const bool can =
      first != curves.by_strength.end() && first->first.compare(0, prefix.size(), prefix) == 0;
  if (can) return "";
  return campaign.program ? kNotDeclared : kNotCalculated;
}

// Nobody takes part in a race.
absl::Status NobodyIn(const campaign::Campaign& campaign, const Race& race) {
  if (campaign.program) {
    return absl::FailedPreconditionError(
        "the program declares no effect (model.effects) that is not part of the model, and none of "
        "the measurement can be calculated on what is read, so there is nothing to ask; "
        "`not_excitable` says why");
  }
  if (!campaign.precomputed) {
    return absl::FailedPreconditionError(
        "no effect of this build can join the model and be seen in the fitted experiments, so "
        "there is nothing to ask; `not_excitable` says why");
  }
  std::vector<std::string> reasons;
  for (const auto& [effect, why] : race.not_excitable) {
    if (why != kNotCalculated) reasons.push_back(absl::StrCat(effect, " (", why, ")"));
  }
  return absl::FailedPreconditionError(
      absl::StrCat("the runs of this campaign were made elsewhere, and no effect can be calculated "
                   "on what they read: ",
                   absl::StrJoin(reasons, ", ")));
}

// By one sd, in the units of which the amplitude of what they change is normal.
std::vector<NumericalChoice> NumericsOfProgram(const campaign::Program& program) {
  std::vector<NumericalChoice> choices;
  choices.reserve(program.numerics.size());
  for (const auto& [name, choice] : program.numerics) {
    choices.push_back({.name = absl::StrCat(campaign::kNumerics, ".", name),
                       .null = choice.null,
                       .tried = choice.null + choice.sd});
  }
  return choices;
}

std::vector<NumericalChoice> NumericsOf(const campaign::Campaign& campaign) {
  if (campaign.precomputed) return {};
  if (campaign.program) return NumericsOfProgram(*campaign.program);
  const bool staged = std::any_of(
      campaign.experiments.begin(), campaign.experiments.end(), [](const auto& experiment) {
        return experiment.role == campaign::Role::kCalibrate && campaign::ReadAtRest(experiment);
      });
  if (!staged) return {};
  // Twice and half, as a study of convergence goes.
  return {{.name = absl::StrCat(campaign::kNumerics, ".rate"), .tried = 2},
          {.name = absl::StrCat(campaign::kNumerics, ".step"), .tried = 0.5},
          {.name = absl::StrCat(campaign::kNumerics, ".damping"), .tried = 2}};
}

// Parameters of a race beside those of the base, in the order of DesignRows::names().
std::vector<campaign::CalibratedParameter> RacingParameters(const Race& race) {
  std::vector<campaign::CalibratedParameter> parameters;
  for (const RacingEffect& effect : race.effects) {
    const double sign = effect.near > 0 ? 1 : -1;
    const double a = effect.null + sign * effect.most, b = effect.null - sign * effect.most_other;
    parameters.push_back({.name = effect.strength,
                          .unit = "1",
                          .prior = {.kind = inference::PriorKind::kUniform,
                                    .min = std::min(a, b),
                                    .max = std::max(a, b)}});
    for (const ShapeParameter& shape : effect.shapes)
      parameters.push_back({.name = shape.name, .unit = "1", .prior = shape.prior});
  }
  for (const NumericalChoice& choice : race.numerics) {
    parameters.push_back({.name = choice.name,
                          .unit = "1",
                          .prior = {.kind = inference::PriorKind::kUniform,
                                    .min = std::min(choice.null, choice.tried),
                                    .max = std::max(choice.null, choice.tried)}});
  }
  return parameters;
}

}  // namespace

std::vector<std::string> Race::Names() const {
  std::vector<std::string> names;
  for (const RacingEffect& effect : effects) {
    if (names.empty() || names.back() != effect.name) names.push_back(effect.name);
  }
  return names;
}

std::string WhyNotShown(const campaign::Campaign& campaign, const dem::EffectInfo& effect) {
  std::set<double> pressures;
  bool varied = false;  // the pressure, within a test
  bool shown = false;
  bool moving = false;
  for (const campaign::Experiment& e : campaign.experiments) {
    const dem::TestInfo* const test = dem::FindTest(e.test);
    if (effect.kind == "particle" && test != nullptr && test->poured &&
        !campaign::CanShow(e, effect)) {
      return absl::StrCat("test ", e.test, " pours its grains, which it leaves whole");
    }
    if (e.role != campaign::Role::kCalibrate) continue;
    const auto pressure = e.settings.find("confining_pressure");
    if (pressure != e.settings.end()) pressures.insert(pressure->second);
    varied = varied || (test != nullptr && !test->one_pressure);
    moving = moving || !campaign::ReadAtRest(e);
    shown = shown || campaign::CanShow(e, effect);
  }
  if (effect.needs_motion && !moving) {
    return "all readings are taken at rest: "
           "it shows in tests with a loading_rate, in collisions and in flows";
  }
  if (!shown) return "none of the fitted tests can show it";
  if (effect.across_pressures && pressures.size() < 2 && !varied) {
    return "it shows only between tests at different pressures, or in one whose pressure changes";
  }
  return "";
}

absl::StatusOr<Race> RaceOf(const report::CampaignView& view,
                            const std::vector<std::string>& without) {
  const campaign::Campaign& campaign = view.campaign;
  const bool elsewhere = !campaign::HasOwnEngine(campaign);
  const EffectsOnCurves curves = elsewhere ? EffectsOnReadings(campaign) : EffectsOnCurves{};
  Race race{.left_out = without};
  for (const campaign::CalibratedParameter& parameter : campaign.parameters)
    race.base.push_back(parameter.name);
  for (const dem::EffectInfo* effect : dem::AllEffects(campaign.model.user_effects)) {
    if (IsAmong(campaign.model.effects, effect->name)) continue;
    const bool held = elsewhere && IsHeld(campaign, effect->name);
    std::string why = elsewhere && !held ? WhyNotCalculated(campaign, curves, effect->name)
                                         : WhyNotJoin(campaign, effect->name);
    if (why.empty() && IsAmong(without, effect->name)) why = "left out as asked for";
    if (why.empty() && !elsewhere) why = WhyNotShown(campaign, *effect);
    std::vector<RacingEffect> entries;
    if (why.empty()) {
      entries =
          elsewhere && !held ? EntriesOnCurves(view, *effect, curves) : EntriesOf(view, *effect);
      if (entries.empty()) why = "the catalogue gives no strength to try";
    }
    if (why.empty()) {
      race.effects.insert(race.effects.end(), entries.begin(), entries.end());
    } else {
      race.not_excitable.emplace_back(effect->name, why);
    }
  }
  if (race.effects.empty()) return NobodyIn(campaign, race);
  for (int a = 0; a < static_cast<int>(race.effects.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(race.effects.size()); ++b) {
      const RacingEffect& one = race.effects[static_cast<std::size_t>(a)];
      const RacingEffect& other = race.effects[static_cast<std::size_t>(b)];
      if (one.name == other.name) continue;
      if (!one.family.empty() && one.family == other.family) race.kin.emplace_back(a, b);
      // Instruments and a denser start exclude nobody.
      const auto& declared = campaign.model.user_effects;
      if (elsewhere ? dem::Exclude(*dem::FindEffect(declared, one.name),
                                   *dem::FindEffect(declared, other.name))
                    : !campaign::WhyNotTogether(campaign, {one.name, other.name}).empty())
        race.excluded.emplace_back(a, b);
    }
  }
  race.numerics = NumericsOf(campaign);
  return race;
}

campaign::Derivation DesignOf(const report::CampaignView& view, const Race& race) {
  campaign::Derivation design{
      .name = absl::StrCat(view.campaign.name, ", runs that tell effects apart"),
      .lineage = {.parent = view.status.campaign(),
                  .purpose = campaign::ToString(campaign::DerivedFor::kDesign)},
      .held_out = false,
      .race = race.Names()};
  for (const campaign::CalibratedParameter& parameter : RacingParameters(race)) {
    design.parameters[parameter.name] = {
        .kind =
            parameter.prior.kind == inference::PriorKind::kLogUniform ? "log_uniform" : "uniform",
        .min = parameter.prior.min,
        .max = parameter.prior.max};
  }
  return design;
}

campaign::Campaign CampaignOfDesign(const campaign::Campaign& base, const Race& race) {
  campaign::Campaign design = base;
  design.method = methods::All().Of(campaign::ChosenBy::kRequest);
  design.race = race.Names();
  for (campaign::CalibratedParameter& parameter : RacingParameters(race))
    design.parameters.push_back(std::move(parameter));
  // What ties the base's parameters stays said of them alone.
  if (design.tied_prior) {
    std::vector<inference::Prior> further;
    for (std::size_t j = base.parameters.size(); j < design.parameters.size(); ++j)
      further.push_back(design.parameters[j].prior);
    design.tied_prior = base.tied_prior->With(further);
  }
  return design;
}

}  // namespace calib::diagnosis
