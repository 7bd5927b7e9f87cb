#include "dem/registry/scenario_problems.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/formula/user_effect.h"
#include "dem/lab_tests/shared/alterations.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/model/test_meshes.h"
#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/material_use.h"
#include "dem/registry/model_parameters.h"
#include "dem/registry/registry.h"

namespace calib::dem {
namespace {

using Problems = std::vector<std::string>;

/// Largest strain that a path may ask for [-]. Chosen: a cell that shrinks to a third is a mistake
/// of units.
constexpr double kLargestStrain = 1.0;

/// Effects of the user that may act at contacts [-]. Chosen: each may ask a contact to remember a
/// number, and kMaxHistory is what there is.
constexpr int kMostFormulas = 4;

template <class Infos>
std::string NamesOf(const Infos& infos) {
  return absl::StrJoin(infos, ", ",
                       [](std::string* out, const auto& info) { out->append(info.name); });
}

void CheckRange(const std::string& name, double value, const ParameterInfo& info,
                const std::string& unit, Problems& problems) {
  const bool above = info.min_open ? value > info.min : value >= info.min;
  if (!(above && value <= info.max)) {
    problems.push_back(absl::StrCat(name, " is ", value, ", allowed is ", info.min_open ? "(" : "[",
                                    info.min, ", ", info.max, "] ", unit));
  } else if (info.whole && value != std::round(value)) {
    problems.push_back(absl::StrCat(name, " is ", value, ", allowed are whole numbers from ",
                                    info.min, " to ", info.max));
  }
}

void CheckPositive(const std::string& what, const std::optional<double>& value,
                   Problems& problems) {
  if (value && !(*value > 0 && std::isfinite(*value))) {
    problems.push_back(absl::StrCat(what, " is ", *value, ", it must be positive and finite"));
  }
}

void CheckFraction(const std::string& what, const std::optional<double>& value,
                   Problems& problems) {
  if (value && !(*value >= 0 && *value < 1)) {
    problems.push_back(absl::StrCat(what, " is ", *value, ", allowed is [0, 1)"));
  }
}

/// Parameters of the law (empty prefix) or of one effect: present, in range, alternatives not given
/// together.
void CheckParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                     const Model& model, Problems& problems) {
  const auto& given = model.parameters;
  for (const ParameterInfo& info : infos) {
    const std::string name = prefix + info.name;
    const auto it = given.find(name);
    if (it != given.end()) {
      CheckRange(name, it->second, info, UnitFor(info, model.contact), problems);
      if (!info.alternative_to.empty() && given.contains(prefix + info.alternative_to)) {
        problems.push_back(absl::StrCat(name, " and ", prefix, info.alternative_to,
                                        " are alternatives: only one of them may be given"));
      }
      continue;
    }
    if (info.default_value || !info.alternative_to.empty()) {
      continue;
    }
    const auto other = std::find_if(infos.begin(), infos.end(), [&](const ParameterInfo& p) {
      return p.alternative_to == info.name && given.contains(prefix + p.name);
    });
    if (other == infos.end()) {
      problems.push_back(absl::StrCat("parameter ", name, " is missing"));
    }
  }
}

void CheckModel(const Model& model, Problems& problems) {
  if (!(model.density > 0 && std::isfinite(model.density))) {
    problems.push_back(
        absl::StrCat("density is ", model.density, ", it must be positive and finite"));
  }
  const ContactInfo* contact = FindContact(model.contact);
  if (contact == nullptr) {
    problems.push_back(
        absl::StrCat("no contact law \"", model.contact, "\"; there are ", NamesOf(Contacts())));
    return;
  }
  CheckParameters(contact->parameters, "", model, problems);
  std::set<std::string> seen;
  for (const std::string& name : model.effects) {
    const EffectInfo* effect = FindEffect(model.user_effects, name);
    if (effect == nullptr) {
      problems.push_back(absl::StrCat("no effect \"", name, "\"; there are ", NamesOf(Effects())));
      continue;
    }
    if (!seen.insert(name).second) {
      problems.push_back(absl::StrCat("effect ", name, " is named twice"));
      continue;
    }
    if (!effect->contacts.empty() && std::find(effect->contacts.begin(), effect->contacts.end(),
                                               model.contact) == effect->contacts.end()) {
      problems.push_back(absl::StrCat("effect ", name, " cannot join contact ", model.contact,
                                      "; it joins ", absl::StrJoin(effect->contacts, ", ")));
    }
    CheckParameters(effect->parameters, name + ".", model, problems);
  }
  for (const auto& [name, value] : model.parameters) {
    const ParameterInfo* info = FindParameter(model, name);
    if (info == nullptr) {
      problems.push_back(absl::StrCat("the model has no parameter \"", name, "\""));
    } else if (FindParameter(model.user_effects, model.contact, model.effects, name) == nullptr) {
      CheckRange(name, value, *info, info->unit, problems);  // of a material
    }
  }
}

/// User's effects: that they can run, and run in this test.
void CheckFormulas(const Scenario& scenario, Problems& problems) {
  const Model& model = scenario.model;
  const TestInfo* test = FindTest(scenario.test);
  std::set<std::string> seen;
  int acting = 0;
  for (const UserEffect& effect : model.user_effects) {
    const std::string& name = effect.info.name;
    if (!seen.insert(name).second) {
      problems.push_back(absl::StrCat("effect ", name, " is declared twice"));
    }
    if (std::find(model.effects.begin(), model.effects.end(), name) == model.effects.end()) {
      continue;
    }
    const auto found = UserEffectProblems(effect);
    for (const std::string& problem : found) {
      problems.push_back(absl::StrCat("effect ", name, ": ", problem));
    }
    if (!found.empty() || test == nullptr) {
      continue;
    }
    acting += effect.info.kind == "contact" ? 1 : 0;
    const bool cell = InPeriodicCell(*test);
    if (!cell && (effect.info.kind == "measurement" || NeedsStage(effect))) {
      problems.push_back(absl::StrCat("effect ", name, " ",
                                      effect.info.kind == "measurement" ? "changes" : "asks for",
                                      " readings of a specimen in the periodic cell, which test ",
                                      test->name, " does not have"));
    }
    const bool stress = effect.target == "axial_stress" || effect.target == "lateral_stress";
    if (effect.target == ControlOf(*test, scenario.settings) ||
        (stress && IsStressDriven(*test, scenario.settings))) {
      problems.push_back(absl::StrCat("effect ", name, " changes ", effect.target,
                                      ", by which test ", test->name, " is driven"));
    }
  }
  if (acting > kMostFormulas) {
    problems.push_back(absl::StrCat(acting, " of the user's effects act at contacts; at most ",
                                    kMostFormulas, " can"));
  }
}

/// Spheres of one id must lie together, within half the cell, for nearest images to be theirs.
void CheckClumps(const Packing& packing, Problems& problems) {
  std::map<int, std::size_t> first;
  for (std::size_t i = 0; i < packing.clump.size(); ++i) {
    const int id = packing.clump[i];
    if (id < 0) {
      continue;
    }
    const std::size_t j = first.emplace(id, i).first->second;
    const std::vector<double>* axes[3] = {&packing.x, &packing.y, &packing.z};
    for (std::size_t a = 0; a < 3; ++a) {
      double apart = std::abs((*axes[a])[i] - (*axes[a])[j]);
      apart -= std::round(apart / packing.length[a]) * packing.length[a];
      if (i != j &&
          std::abs(apart) + packing.radius[i] + packing.radius[j] > 0.5 * packing.length[a]) {
        problems.push_back(absl::StrCat("grains ", j, " and ", i, " of clump ", id, " lie ",
                                        std::abs(apart), " m apart along axis ", a,
                                        ": a clump must be smaller than half the cell (",
                                        0.5 * packing.length[a], " m)"));
        return;
      }
    }
  }
}

void CheckPacking(const Packing& packing, bool poured, Problems& problems) {
  const std::size_t n = packing.x.size();
  if (n < 2 || packing.y.size() != n || packing.z.size() != n || packing.radius.size() != n ||
      packing.clump.size() != n) {
    problems.emplace_back(
        "the packing needs at least two grains and as many x, y, z, radii and clump ids");
    return;
  }
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(packing.x[i] + packing.y[i] + packing.z[i]) ||
        !(packing.radius[i] > 0 && std::isfinite(packing.radius[i]))) {
      problems.push_back(
          absl::StrCat("grain ", i, " has no finite position or no positive radius"));
      return;
    }
    largest = std::max(largest, packing.radius[i]);
  }
  for (int a = 0; a < 3 && !poured; ++a) {
    if (!(packing.length[a] > 4 * largest && std::isfinite(packing.length[a]))) {
      problems.push_back(absl::StrCat("the cell is ", packing.length[a], " m long along axis ", a,
                                      ", it must be longer than two of its largest grains (",
                                      4 * largest, " m)"));
    }
  }
  if (problems.empty() && !poured) {
    CheckClumps(packing, problems);
  }
}

/// Effects that know single spheres only.
void CheckShapes(const Scenario& scenario, bool poured, Problems& problems) {
  const bool clumps = std::any_of(scenario.packing.clump.begin(), scenario.packing.clump.end(),
                                  [](int id) { return id >= 0; });
  if (clumps && poured) {
    problems.push_back(absl::StrCat("test ", scenario.test,
                                    " pours single spheres (clump -1), this packing has clumps"));
  }
  for (const std::string& name : scenario.model.effects) {
    const EffectInfo* effect = FindEffect(name);
    if (poured && effect != nullptr && effect->breaks_grains) {
      problems.push_back(absl::StrCat("effect ", name, " is not there in test ", scenario.test,
                                      ", which leaves the grains that it pours whole"));
    }
  }
  for (std::string& problem : ShapeProblems(scenario.model, clumps)) {
    problems.push_back(std::move(problem));
  }
}

void CheckTest(const Scenario& scenario, Problems& problems) {
  const TestInfo* test = FindTest(scenario.test);
  if (test == nullptr) {
    problems.push_back(
        absl::StrCat("no test \"", scenario.test, "\"; there are ", NamesOf(Tests())));
    return;
  }
  for (const ParameterInfo& info : test->settings) {
    const auto it = scenario.settings.find(info.name);
    if (it != scenario.settings.end()) {
      CheckRange(info.name, it->second, info, info.unit, problems);
    } else if (!info.default_value && info.name != ControlOf(*test, scenario.settings)) {
      problems.push_back(absl::StrCat("test ", scenario.test, " needs the setting ", info.name));
    }
  }
  for (const auto& setting : scenario.settings) {
    const std::string& name = setting.first;
    const bool says_control = name == kStressDriven && !test->stress_control.empty();
    if (!says_control &&
        std::none_of(test->settings.begin(), test->settings.end(),
                     [&](const ParameterInfo& info) { return info.name == name; })) {
      problems.push_back(absl::StrCat("test ", scenario.test, " has no setting \"", name, "\""));
    }
  }
  if (const auto& own = FindTestEntry(scenario.test)->problems; own != nullptr) {
    for (std::string& problem : own(scenario)) {
      problems.push_back(std::move(problem));
    }
  }
  const bool stress_driven = IsStressDriven(*test, scenario.settings);
  const auto& range = test->control_range;
  const std::string control = ControlOf(*test, scenario.settings);
  const auto driven = std::find_if(test->settings.begin(), test->settings.end(),
                                   [&](const ParameterInfo& info) { return info.name == control; });
  std::set<int> steps;
  for (std::size_t k = 0; k < scenario.path.size(); ++k) {
    const ControlPoint& point = scenario.path[k];
    if (driven != test->settings.end()) {
      CheckRange(absl::StrCat("path point ", k, ": ", control), point.target, *driven, driven->unit,
                 problems);
    }
    const bool sensible = range           ? point.target >= range->min && point.target <= range->max
                          : stress_driven ? point.target > 0 && std::isfinite(point.target)
                                          : std::abs(point.target) < kLargestStrain;
    if (sensible && range && range->whole && point.target != std::round(point.target)) {
      problems.push_back(absl::StrCat("path point ", k, ": ", test->control, " is ", point.target,
                                      ", allowed are whole numbers from ", range->min, " to ",
                                      range->max));
    }
    if (!sensible && range) {
      problems.push_back(absl::StrCat("path point ", k, ": ", test->control, " is ", point.target,
                                      ", allowed is [", range->min, ", ", range->max, "]"));
    } else if (!sensible && driven == test->settings.end()) {
      problems.push_back(
          absl::StrCat("path point ", k, ": ", control, " is ", point.target,
                       stress_driven ? ", it must be positive" : ", allowed is (-1, 1)"));
    }
    if (point.load_step >= 0 && !steps.insert(point.load_step).second) {
      problems.push_back(
          absl::StrCat("path point ", k, ": load step ", point.load_step, " occurs twice"));
    }
  }
  if (scenario.path.empty()) {
    problems.emplace_back("the control path is empty");
  }
  if (stress_driven && scenario.loading_rate) {
    problems.push_back(
        absl::StrCat("test ", scenario.test, " is driven by stress and has no loading_rate"));
  }
}

void CheckPreparation(const Scenario& scenario, Problems& problems) {
  const Consolidation& c = scenario.consolidation;
  if (c.friction_coefficient && c.porosity) {
    problems.emplace_back("consolidation takes friction_coefficient or porosity, not both");
  }
  if (c.friction_coefficient && !(*c.friction_coefficient >= 0 && *c.friction_coefficient <= 14)) {
    problems.push_back(absl::StrCat("consolidation friction_coefficient is ",
                                    *c.friction_coefficient, ", allowed is [0, 14]"));
  }
  if (c.porosity && !(*c.porosity > 0 && *c.porosity < 1)) {
    problems.push_back(
        absl::StrCat("consolidation porosity is ", *c.porosity, ", allowed is (0, 1)"));
  }
  if (scenario.initial_stress) {
    CheckPositive("initial_stress axial", scenario.initial_stress->axial, problems);
    CheckPositive("initial_stress lateral", scenario.initial_stress->lateral, problems);
  }
  CheckPositive("loading_rate", scenario.loading_rate, problems);
  CheckPositive("staging rate", scenario.staging.rate, problems);
  CheckPositive("staging step", scenario.staging.step, problems);
  CheckPositive("staging unbalanced", scenario.staging.unbalanced, problems);
  CheckFraction("staging damping while loading", scenario.staging.damping_loading, problems);
  CheckFraction("staging damping while settling", scenario.staging.damping_settling, problems);
  if (scenario.threads < 1 || scenario.threads > 1024) {
    problems.push_back(absl::StrCat("threads is ", scenario.threads, ", allowed is 1 .. 1024"));
  }
}

}  // namespace

std::vector<std::string> ScenarioProblems(const Scenario& scenario) {
  Problems problems;
  CheckModel(scenario.model, problems);
  for (auto& more : {MaterialProblems(scenario.model), MaterialUseProblems(scenario)}) {
    problems.insert(problems.end(), more.begin(), more.end());
  }
  const TestInfo* test = FindTest(scenario.test);
  if (test == nullptr || test->needs_packing) {
    const bool poured = test != nullptr && test->poured;
    CheckPacking(scenario.packing, poured, problems);
    CheckShapes(scenario, poured, problems);
  }
  CheckTest(scenario, problems);
  if (test != nullptr) {
    CheckMeshes(scenario, *test, problems);
  }
  CheckFormulas(scenario, problems);
  CheckPreparation(scenario, problems);
  return problems;
}

GrainRemarks GrainRemarksOf(const Scenario& scenario, const std::vector<double>& radii) {
  GrainRemarks remarks;
  const TestEntry* entry = FindTestEntry(scenario.test);
  if (entry != nullptr && entry->grain_remarks != nullptr) {
    const auto thickness = scenario.settings.find("thickness");
    const bool disks = thickness != scenario.settings.end() && thickness->second > 0;
    const double aspect = PreparationOf(scenario.model, EntriesOf(scenario.model)).aspect;
    double widest = 0;  // sphere of a grain of radius 1
    for (const Sphere& sphere : GrainShape(aspect, disks).spheres) {
      widest = std::max(widest, sphere.radius);
    }
    remarks = entry->grain_remarks(scenario, {.radii = radii, .thickness = widest});
  }
  const double largest = 2 * *std::max_element(radii.begin(), radii.end());
  if (std::string problem = MeshSizeProblem(scenario, largest); !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
  }
  return remarks;
}

}  // namespace calib::dem
