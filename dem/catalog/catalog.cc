#include "dem/catalog/catalog.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/catalog/registry.h"
#include "dem/elementary/functions.h"
#include "dem/formula/user_effect.h"
#include "dem/lab_tests/collision.h"

namespace calib::dem {
namespace {

template <class Info, class Entry>
std::vector<Info> InfosOf(std::span<const Entry> entries) {
  std::vector<Info> infos;
  infos.reserve(entries.size());
  for (const Entry& entry : entries) {
    infos.push_back(entry.info);
  }
  return infos;
}

template <class Info>
const Info* FindByName(std::span<const Info> infos, const std::string& name) {
  const auto it =
      std::find_if(infos.begin(), infos.end(), [&](const Info& i) { return i.name == name; });
  return it == infos.end() ? nullptr : &*it;
}

void Append(std::string& text, const ParameterInfo& p) {
  absl::StrAppend(&text, "  ", p.name, " [", p.unit, "]");
  for (const auto& [contact, unit] : p.unit_by_contact) {
    absl::StrAppend(&text, " ", contact, ":[", unit, "]");
  }
  absl::StrAppend(&text, p.min_open ? " (" : " [", p.min, ", ", p.max, "] ", p.default_prior.kind,
                  " ", p.default_prior.min, " ", p.default_prior.max);
  if (p.default_value) {
    absl::StrAppend(&text, " default ", *p.default_value);
  }
  if (p.null_value) {
    absl::StrAppend(&text, " null ", *p.null_value);
  }
  for (const auto& [contact, null] : p.null_by_contact) {
    absl::StrAppend(&text, " ", contact, ":null ", null);
  }
  absl::StrAppend(&text, p.of_pairs ? " of pairs" : "",
                  p.alternative_to.empty() ? "" : " alternative to ", p.alternative_to, ": ",
                  p.description, "\n");
}

}  // namespace

std::span<const ContactInfo> Contacts() {
  static const std::vector<ContactInfo> infos = InfosOf<ContactInfo>(ContactEntries());
  return infos;
}

std::span<const EffectInfo> Effects() {
  static const std::vector<EffectInfo> infos = InfosOf<EffectInfo>(EffectEntries());
  return infos;
}

std::span<const TestInfo> Tests() {
  static const std::vector<TestInfo> infos = [] {
    auto all = InfosOf<TestInfo>(ElementTestEntries());
    const auto poured = InfosOf<TestInfo>(GravityTestEntries());
    all.insert(all.end(), poured.begin(), poured.end());
    all.push_back(Collision());
    return all;
  }();
  return infos;
}

std::span<const ObservableInfo> Observables() {
  static const std::vector<ObservableInfo> infos = {
      {.name = "axial_strain",
       .unit = "1",
       .description = "logarithmic, from the end of consolidation"},
      {.name = "volumetric_strain",
       .unit = "1",
       .description = "sum of the three logarithmic strains"},
      {.name = "lateral_strain",
       .unit = "1",
       .description = "mean of the two lateral logarithmic strains"},
      {.name = "axial_stress", .unit = "Pa", .description = "Love-Weber stress along z"},
      {.name = "lateral_stress",
       .unit = "Pa",
       .description = "mean Love-Weber stress along x and y"},
      {.name = "mean_stress", .unit = "Pa", .description = "p = (axial + 2 lateral)/3"},
      {.name = "deviatoric_stress", .unit = "Pa", .description = "q = axial - lateral"},
      {.name = "stress_ratio", .unit = "1", .description = "axial over lateral stress"},
      {.name = "q_over_p", .unit = "1", .description = "deviatoric over mean stress"},
      {.name = "shear_strain",
       .unit = "1",
       .description = "displacement of the top over the height at the end of consolidation"},
      {.name = "shear_stress",
       .unit = "Pa",
       .description = "Love-Weber stress on horizontal planes along the shear, mean of xz and zx"},
      {.name = "shear_stress_ratio",
       .unit = "1",
       .description = "shear stress over axial (normal) stress"},
      {.name = "pore_pressure",
       .unit = "Pa",
       .description = "excess pore pressure at constant cell pressure: lateral stress at the end "
                      "of consolidation - effective lateral stress"},
      {.name = "porosity", .unit = "1", .description = "void volume over cell volume"},
      {.name = "void_ratio", .unit = "1", .description = "void volume over solid volume"},
      {.name = "impact_angle",
       .unit = "rad",
       .description = "between the relative velocity before impact and the normal"},
      {.name = "impact_speed", .unit = "m/s", .description = "relative speed before impact"},
      {.name = "impact_spin",
       .unit = "rad/s",
       .description = "spin before impact, positive where it adds to the slip"},
      {.name = "normal_restitution",
       .unit = "1",
       .description = "normal relative velocity after over before impact, turned round"},
      {.name = "tangential_restitution",
       .unit = "1",
       .description = "tangential relative velocity of the centres after over before impact"},
      {.name = "energy_restitution",
       .unit = "1",
       .description = "kinetic energy of the relative motion and of spin, after over before"},
      {.name = "rebound_angle", .unit = "rad", .description = "to the normal, after impact"},
      {.name = "rebound_spin", .unit = "rad/s", .description = "spin of the body after impact"},
      {.name = "contact_duration", .unit = "s", .description = "of the collision"},
      {.name = "peak_overlap", .unit = "m", .description = "largest overlap in the collision"},
      {.name = "coordination_number",
       .unit = "1",
       .description = "2 contacts / grains, all grains counted"},
      {.name = "time", .unit = "s", .description = "since the motion began"},
      {.name = "repetition", .unit = "1", .description = "number of a repeat, each poured anew"},
      {.name = "opening", .unit = "m", .description = "diameter or width of an outlet"},
      {.name = "rotation_speed", .unit = "rad/s", .description = "of a drum"},
      {.name = "belt_speed", .unit = "m/s", .description = "of a conveyor"},
      {.name = "angle_of_repose", .unit = "rad", .description = "slope of a free surface"},
      {.name = "angle_fluctuation",
       .unit = "rad",
       .description = "standard deviation of that slope in time"},
      {.name = "heap_height", .unit = "m", .description = "of a heap above its floor"},
      {.name = "mass_flow_rate", .unit = "kg/s", .description = "through an outlet"},
      {.name = "discharged_mass", .unit = "kg", .description = "that has left a container"},
      {.name = "avalanche_size",
       .unit = "1",
       .description = "mean number of grains that leave until an arch stops the flow"},
      {.name = "avalanche_count",
       .unit = "1",
       .description = "number of avalanches that an arch ended"},
      {.name = "avalanche_median",
       .unit = "1",
       .description = "size that at most half of the avalanches exceed"},
      {.name = "avalanche_p90",
       .unit = "1",
       .description = "size that at most a tenth of the avalanches exceed"},
      {.name = "jams", .unit = "1", .description = "number of arches that stopped the flow"},
      {.name = "slide_time",
       .unit = "s",
       .description = "from opening until the material has slid past a plane"},
      {.name = "mass_flow_left", .unit = "kg/s", .description = "to the side of negative y"},
      {.name = "mass_flow_right", .unit = "kg/s", .description = "to the side of positive y"},
      {.name = "mass_flow_difference",
       .unit = "kg/s",
       .description = "absolute difference of the flows to both sides"},
      {.name = "intruder_height",
       .unit = "m",
       .description = "of the large grain's centre above the floor of its box"},
      {.name = "fraction_above",
       .unit = "1",
       .description = "share of the time that the large grain has been above a height"},
      {.name = "exit_time",
       .unit = "s",
       .description = "when the large grain first reached a height; the present time before"},
  };
  return infos;
}

const ContactInfo* FindContact(const std::string& name) { return FindByName(Contacts(), name); }
const EffectInfo* FindEffect(const std::string& name) { return FindByName(Effects(), name); }

bool Exclude(const EffectInfo& a, const EffectInfo& b) {
  const auto names = [](const EffectInfo& one, const EffectInfo& other) {
    return std::find(one.excludes.begin(), one.excludes.end(), other.name) != one.excludes.end();
  };
  return names(a, b) || names(b, a);
}
const TestInfo* FindTest(const std::string& name) { return FindByName(Tests(), name); }
const ObservableInfo* FindObservable(const std::string& name) {
  return FindByName(Observables(), name);
}

const std::string& UnitFor(const ParameterInfo& parameter, const std::string& contact) {
  const auto it = parameter.unit_by_contact.find(contact);
  return it == parameter.unit_by_contact.end() ? parameter.unit : it->second;
}

double ScaleOf(const ParameterInfo& parameter, const std::string& contact,
               const ReferenceState& state) {
  const auto it = parameter.scale_by_contact.find(contact);
  const ReferenceScale& s = it == parameter.scale_by_contact.end() ? parameter.scale : it->second;
  return s.factor * Pow(state.pressure, s.pressure) * Pow(state.diameter, s.diameter) *
         Pow(state.modulus, s.modulus);
}

std::optional<double> NullValueOf(const ParameterInfo& parameter, const std::string& contact) {
  const auto it = parameter.null_by_contact.find(contact);
  return it == parameter.null_by_contact.end() ? parameter.null_value
                                               : std::optional<double>(it->second);
}

DefaultPrior PriorOf(const ParameterInfo& parameter, const std::string& contact,
                     const ReferenceState& state) {
  if (!parameter.scaled_prior) {
    return parameter.default_prior;
  }
  const double scale = ScaleOf(parameter, contact, state);
  return {.kind = parameter.scaled_prior->kind,
          .min = std::max(parameter.min, parameter.scaled_prior->min * scale),
          .max = std::min(parameter.max, parameter.scaled_prior->max * scale)};
}

namespace {

/// The ray's parameter and its value at a distance from the null.
double ValueOnRay(const ParameterInfo& parameter, double step, const std::string& contact,
                  const ReferenceState& state) {
  const auto null = NullValueOf(parameter, contact);
  assert(null);
  return step == 0 ? *null : *null + step * ScaleOf(parameter, contact, state);
}

const ParameterInfo& ParameterOf(const EffectInfo& effect, const std::string& name) {
  const auto* info = FindByName(std::span<const ParameterInfo>(effect.parameters), name);
  assert(info != nullptr);
  return *info;
}

}  // namespace

std::map<std::string, double> ParametersOnRay(const EffectInfo& effect, const StrengthRay& ray,
                                              double step, const std::string& contact,
                                              const ReferenceState& state) {
  const std::string prefix = effect.name + ".";
  std::map<std::string, double> values;
  values[prefix + ray.parameter] =
      ValueOnRay(ParameterOf(effect, ray.parameter), step, contact, state);
  for (const auto& [name, scaled] : ray.held) {
    values[prefix + name] = scaled * ScaleOf(ParameterOf(effect, name), contact, state);
  }
  return values;
}

bool RayAdmits(const EffectInfo& effect, const StrengthRay& ray, double step,
               const std::string& contact, const ReferenceState& state) {
  const ParameterInfo& parameter = ParameterOf(effect, ray.parameter);
  const double value = ValueOnRay(parameter, step, contact, state);
  return (parameter.min_open ? value > parameter.min : value >= parameter.min) &&
         value <= parameter.max;
}

const ParameterInfo* FindParameter(const std::string& contact, std::span<const std::string> effects,
                                   const std::string& dotted_name) {
  const auto dot = dotted_name.find('.');
  if (dot == std::string::npos) {
    const ContactInfo* info = FindContact(contact);
    return info == nullptr
               ? nullptr
               : FindByName(std::span<const ParameterInfo>(info->parameters), dotted_name);
  }
  const std::string prefix = dotted_name.substr(0, dot);
  const EffectInfo* info = FindEffect(prefix);
  if (info == nullptr || std::find(effects.begin(), effects.end(), prefix) == effects.end()) {
    return nullptr;
  }
  return FindByName(std::span<const ParameterInfo>(info->parameters), dotted_name.substr(dot + 1));
}

std::string CatalogText() {
  std::string text = absl::StrCat("engine ", EngineVersion(), "\n");
  for (const ContactInfo& c : Contacts()) {
    absl::StrAppend(&text, "contact ", c.name, ": ", c.description, " {", c.reference, "}\n");
    for (const ParameterInfo& p : c.parameters) {
      Append(text, p);
    }
  }
  for (const EffectInfo& e : Effects()) {
    absl::StrAppend(&text, "effect ", e.name, " (", e.kind, "; ", absl::StrJoin(e.contacts, " "),
                    "): ", e.description, " {", e.reference, "}\n");
    for (const ParameterInfo& p : e.parameters) {
      Append(text, p);
    }
  }
  for (const TestInfo& t : Tests()) {
    absl::StrAppend(&text, "test ", t.name, " control ", t.control,
                    t.may_reverse ? " reversible" : "", ": ", t.description, " {", t.reference,
                    "} ", absl::StrJoin(t.observables, " "), "\n");
    for (const ParameterInfo& p : t.settings) {
      Append(text, p);
    }
    for (const MeshInfo& m : t.meshes) {
      absl::StrAppend(&text, "mesh ", m.name, ": ", m.description, "\n");
    }
  }
  for (const auto& quantities :
       {ContactQuantities(), StageQuantities(), ContactTargets(), ReadingTargets()}) {
    for (const FormulaQuantity& q : quantities) {
      absl::StrAppend(&text, "formula ", q.name, " [", q.unit, "]: ", q.description, "\n");
    }
  }
  for (const ObservableInfo& o : Observables()) {
    absl::StrAppend(&text, "observable ", o.name, " [", o.unit, "]: ", o.description, "\n");
  }
  return text;
}

std::string EngineVersion() { return "14"; }

}  // namespace calib::dem
