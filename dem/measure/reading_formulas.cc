#include "dem/measure/reading_formulas.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "dem/model/model.h"

namespace calib::dem {
namespace {

/// Readings that others are derived from.
bool IsBasic(double Measurement::*target) {
  return target == &Measurement::axial_stress || target == &Measurement::lateral_stress ||
         target == &Measurement::shear_stress || target == &Measurement::porosity;
}

}  // namespace

ReadingFormulas::ReadingFormulas(const Model& model) {
  for (const UserEffect& effect : model.user_effects) {
    const std::string& name = effect.info.name;
    if (effect.info.kind != "measurement" ||
        std::find(model.effects.begin(), model.effects.end(), name) == model.effects.end()) {
      continue;
    }
    const ParameterSet values =
        ResolveParameters(effect.info.parameters, name + ".", model.parameters);
    std::vector<double> parameters;
    for (const ParameterInfo& p : effect.info.parameters) parameters.push_back(values.Get(p.name));
    changes_.push_back({.effect = effect,
                        .formula = Formula(effect.formula, FormulaNames(effect)),
                        .parameters = parameters,
                        .target = MemberNamed(effect.target)});
  }
}

absl::Status ReadingFormulas::Apply(Measurement& m) const {
  const Measurement given = m;
  std::vector<double> values;
  for (const Change& change : changes_) {
    const auto quantities = ReadingQuantities();
    std::vector<double> row;
    for (const int i : change.formula.used()) {
      const auto index = static_cast<std::size_t>(i);
      row.push_back(index < quantities.size() ? given.*MemberNamed(quantities[index].name)
                                              : change.parameters[index - quantities.size()]);
    }
    double value = 0;
    change.formula.Evaluate(row.data(), 1, &value);
    if (!std::isfinite(value)) {
      std::string what = absl::StrCat("effect ", change.effect.info.name, ": ",
                                      change.effect.formula, " is ", value, " at ");
      const std::vector<std::string> names = FormulaNames(change.effect);
      for (std::size_t v = 0; v < row.size(); ++v) {
        absl::StrAppend(&what, v > 0 ? ", " : "",
                        names[static_cast<std::size_t>(change.formula.used()[v])], " = ", row[v]);
      }
      return absl::OutOfRangeError(what);
    }
    values.push_back(value);
  }
  bool derive = false;
  for (const bool basic : {true, false}) {
    for (std::size_t c = 0; c < changes_.size(); ++c) {
      if (IsBasic(changes_[c].target) != basic) continue;
      double& reading = m.*changes_[c].target;
      const double changed = changes_[c].effect.action == FormulaAction::kScales
                                 ? reading * values[c]
                                 : reading + values[c];
      derive = derive || (basic && changed != reading);  // nothing changed: the same bits
      reading = changed;
    }
    if (basic && derive) {
      DeriveReadings(m);
      m.pore_pressure -= m.lateral_stress - given.lateral_stress;
    }
  }
  return absl::OkStatus();
}

}  // namespace calib::dem
