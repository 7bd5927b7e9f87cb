#include "dem/formula/user_effect.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/formula/formula.h"
#include "dem/model/readings.h"

namespace calib::dem {
namespace {

/// Parameters that an effect of a user may have [-]. Chosen: a formula is a line.
constexpr std::size_t kMostParameters = 8;

constexpr const char* kNameRule =
    "a name is made of letters, digits and _ and begins with a letter";

bool IsNamePart(unsigned char c) { return std::isalnum(c) != 0 || c == '_'; }

const std::vector<FormulaQuantity>& Contact() {
  static const auto* const all = new std::vector<FormulaQuantity>{
      {"overlap", "m", "of the two surfaces; 0 where a contact is held apart"},
      {"closing_velocity", "m/s", "rate at which the overlap grows"},
      {"sliding_velocity", "m/s", "size of the tangential velocity of the surfaces"},
      {"sliding_distance", "m", "path of sliding and shear since the contact was made"},
      {"normal_force", "N", "before this effect, repulsion positive"},
      {"normal_stiffness", "N/m", "d normal force / d overlap of the contact law"},
      {"tangential_stiffness", "N/m", "of the shear spring"},
      {"shear_force", "N", "size of it; only where the target is shear_force"},
      {"friction_coefficient", "1", "tan(phi_mu), or what replaces it during consolidation"},
      {"effective_radius", "m", "r1 r2/(r1 + r2); at a wall the grain's radius"},
      {"smaller_radius", "m", "of the two grains"},
      {"larger_radius", "m", "of the two grains"},
      {"effective_mass", "kg", "m1 m2/(m1 + m2); at a wall the grain's"},
  };
  return *all;
}

const std::vector<FormulaQuantity>& Stage() {
  static const auto* const all = new std::vector<FormulaQuantity>{
      {"mean_stress", "Pa", "p = (axial + 2 lateral)/3 of the specimen"},
      {"deviatoric_stress", "Pa", "q = axial - lateral"},
      {"axial_strain", "1", "logarithmic, from the end of consolidation"},
      {"volumetric_strain", "1", "logarithmic, from the end of consolidation"},
      {"porosity", "1", "void volume over cell volume"},
  };
  return *all;
}

const std::vector<FormulaQuantity>& ReadingsAsQuantities() {
  static const auto* const all = [] {
    auto* list = new std::vector<FormulaQuantity>;
    for (const ReadingEntry& reading : Readings()) {
      list->push_back({reading.info.name, reading.info.unit, reading.info.description});
    }
    return list;
  }();
  return *all;
}

bool IsName(const std::string& name) {
  return !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) != 0 &&
         std::all_of(name.begin(), name.end(), &IsNamePart);
}

bool Has(std::span<const FormulaQuantity> list, const std::string& name) {
  return std::any_of(list.begin(), list.end(),
                     [&](const FormulaQuantity& q) { return q.name == name; });
}

std::string Names(std::span<const FormulaQuantity> list) {
  std::string names;
  for (const FormulaQuantity& q : list) absl::StrAppend(&names, names.empty() ? "" : ", ", q.name);
  return names;
}

/// Whether the formula, which can be read, uses one of the names.
bool Mentions(const UserEffect& effect, std::span<const FormulaQuantity> names) {
  const std::vector<std::string> all = FormulaNames(effect);
  const Formula formula(effect.formula, all);
  return std::any_of(formula.used().begin(), formula.used().end(),
                     [&](int i) { return Has(names, all[static_cast<std::size_t>(i)]); });
}

/// Values that quantities usually have, for probing a formula; `which` chooses among them.
double Probe(const FormulaQuantity& quantity, int which) {
  // About the usual value, either way [-]. Chosen.
  static constexpr double kFactor[] = {1, 0.2, 5};
  const double factor = kFactor[which % 3];
  if (quantity.unit == "Pa") return 1e5 * factor;
  if (quantity.unit == "N") return 0.1 * factor;
  if (quantity.unit == "N/m") return 1e5 * factor;
  if (quantity.unit == "kg") return 1e-6 * factor;
  if (quantity.unit == "m/s") return 1e-3 * factor;
  if (quantity.name == "overlap") return 1e-7 * factor;
  if (quantity.unit == "m") return 5e-4 * factor;
  return 0.05 * factor;
}

/// Value of the formula with quantities at one of their usual values, parameters at the middle of
/// their prior or, `removed`, at their null; the quantity `zero` is zero.
double ProbedValue(const UserEffect& effect, const Formula& formula, int which, bool removed,
                   const std::string& zero = "") {
  const std::vector<FormulaQuantity> quantities = QuantitiesOf(effect.info.kind);
  std::vector<double> row;
  for (const int i : formula.used()) {
    const auto index = static_cast<std::size_t>(i);
    if (index < quantities.size()) {
      const FormulaQuantity& quantity = quantities[index];
      row.push_back(quantity.name == zero ? 0 : Probe(quantity, which));
      continue;
    }
    const ParameterInfo& p = effect.info.parameters[index - quantities.size()];
    const double low = p.default_prior.min;
    const double high = p.default_prior.max;
    const double middle =
        p.default_prior.kind == "log_uniform" ? std::sqrt(low * high) : low + 0.7 * (high - low);
    row.push_back(removed && p.null_value ? *p.null_value
                  : p.default_value       ? *p.default_value
                                          : middle);
  }
  double value = 0;
  formula.Evaluate(row.data(), 1, &value);
  return value;
}

/// Values at which a formula is probed [-]: the factors of Probe().
constexpr int kProbes = 3;

/// Quantities that are zero in every run: before loading, at rest, where a contact begins.
constexpr const char* kZeros[] = {"overlap",          "closing_velocity", "sliding_velocity",
                                  "sliding_distance", "axial_strain",     "volumetric_strain",
                                  "deviatoric_stress"};

}  // namespace

std::span<const FormulaQuantity> ContactQuantities() { return Contact(); }
std::span<const FormulaQuantity> StageQuantities() { return Stage(); }
std::span<const FormulaQuantity> ReadingQuantities() { return ReadingsAsQuantities(); }

std::span<const FormulaQuantity> ContactTargets() {
  static const auto* const all = new std::vector<FormulaQuantity>{
      {"normal_force", "N", "repulsion positive; friction follows it"},
      {"attraction", "N", "pulls; the sliding limit does not feel it missing"},
      {"shear_force", "N", "against the sliding, up to the sliding limit"},
      {"friction_coefficient", "1", "its sliding limit; a negative factor counts as 0"},
  };
  return *all;
}

std::span<const FormulaQuantity> ReadingTargets() {
  static const auto* const all = [] {
    auto* list = new std::vector<FormulaQuantity>;
    for (const FormulaQuantity& q : ReadingsAsQuantities()) {
      if (q.name != "axial_strain" && q.name != "shear_strain") list->push_back(q);
    }
    return list;
  }();
  return *all;
}

std::string KindOfTarget(const std::string& target) {
  return Has(ReadingTargets(), target) ? "measurement" : "contact";
}

std::vector<FormulaQuantity> QuantitiesOf(const std::string& kind) {
  if (kind == "measurement") return ReadingsAsQuantities();
  std::vector<FormulaQuantity> all = Contact();
  all.insert(all.end(), Stage().begin(), Stage().end());
  return all;
}

std::vector<std::string> FormulaNames(const UserEffect& effect) {
  std::vector<std::string> names;
  for (const FormulaQuantity& q : QuantitiesOf(effect.info.kind)) names.push_back(q.name);
  for (const ParameterInfo& p : effect.info.parameters) names.push_back(p.name);
  return names;
}

bool IsViscous(const UserEffect& effect) {
  static const auto* const velocities =
      new std::vector<FormulaQuantity>{{"closing_velocity", "", ""}, {"sliding_velocity", "", ""}};
  return effect.info.kind == "contact" && Mentions(effect, *velocities);
}

bool NeedsStage(const UserEffect& effect) {
  return effect.info.kind == "contact" && Mentions(effect, Stage());
}

std::vector<std::string> UserEffectProblems(const UserEffect& effect, bool name_taken) {
  std::vector<std::string> problems;
  const EffectInfo& info = effect.info;
  if (!IsName(info.name)) {
    problems.push_back(absl::StrCat("'", info.name, "': ", kNameRule));
  } else if (name_taken) {
    problems.push_back(absl::StrCat("there is an effect ", info.name, " in this build already"));
  }
  const bool contact = info.kind == "contact";
  const auto targets = contact ? ContactTargets() : ReadingTargets();
  if (!Has(targets, effect.target)) {
    problems.push_back(absl::StrCat(effect.target, " cannot be changed by a formula; it may be ",
                                    Names(ContactTargets()),
                                    " of a contact, or a reading: ", Names(ReadingTargets())));
  } else if (contact) {
    const bool scales = effect.action == FormulaAction::kScales;
    const bool friction = effect.target == "friction_coefficient";
    if (scales && !friction && effect.target != "normal_force") {
      problems.push_back(absl::StrCat(effect.target,
                                      " can be added to, not scaled; scales: normal_force or "
                                      "friction_coefficient"));
    }
    if (!scales && friction) {
      problems.emplace_back("friction_coefficient can be scaled, not added to");
    }
  }
  if (info.parameters.size() > kMostParameters) {
    problems.push_back(absl::StrCat("there are ", info.parameters.size(), " parameters; at most ",
                                    kMostParameters, " are allowed"));
  }
  const std::vector<FormulaQuantity> quantities = QuantitiesOf(info.kind);
  for (const ParameterInfo& p : info.parameters) {
    const auto& functions = FormulaFunctions();
    if (!IsName(p.name)) {
      problems.push_back(absl::StrCat("parameter '", p.name, "': ", kNameRule));
    } else if (Has(quantities, p.name) || p.name == "pi" ||
               std::find(functions.begin(), functions.end(), p.name) != functions.end()) {
      problems.push_back(absl::StrCat("parameter ", p.name,
                                      " has the name of a quantity or a function; choose another"));
    }
  }
  if (!problems.empty()) return problems;
  if (const auto problem = Formula::Check(effect.formula, FormulaNames(effect));
      !problem.message.empty()) {
    return {absl::StrCat("formula, character ", problem.position, ": ", problem.message)};
  }
  static const auto* const shear = new std::vector<FormulaQuantity>{{"shear_force", "", ""}};
  if (contact && effect.target != "shear_force" && Mentions(effect, *shear)) {
    problems.emplace_back("shear_force is known only to a formula that adds to shear_force");
  }
  return problems;
}

std::string NullProblem(const UserEffect& effect) {
  const Formula formula(effect.formula, FormulaNames(effect));
  const double none = effect.action == FormulaAction::kAdds ? 0 : 1;
  std::string nulls;
  for (const ParameterInfo& p : effect.info.parameters) {
    if (p.null_value) {
      absl::StrAppend(&nulls, nulls.empty() ? "" : ", ", p.name, " = ", *p.null_value);
    }
  }
  bool finite = false;
  for (int which = 0; which < kProbes; ++which) {
    const double value = ProbedValue(effect, formula, which, true);
    if (value != none) {
      return absl::StrCat("is ", value, " at the null value (", nulls, "), but has to be ", none,
                          " there, so that the model without the effect is part of it");
    }
    finite = finite || std::isfinite(ProbedValue(effect, formula, which, false));
  }
  if (!finite)
    return "is not finite at usual values of its quantities and the middle of its priors";
  for (const char* zero : kZeros) {
    if (std::isfinite(ProbedValue(effect, formula, 0, false, zero))) continue;
    return absl::StrCat("is not finite where ", zero,
                        " is zero, as it is in every run; say what it is there, e.g. with max(",
                        zero, ", ...) or ", zero, " > 0 ? ... : ", none);
  }
  return "";
}

}  // namespace calib::dem
