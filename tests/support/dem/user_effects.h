#pragma once
// Effects written as formulas, for tests of the engine.

#include <string>
#include <vector>

#include "dem/formula/user_effect.h"
#include "dem/model/scenario.h"

namespace calib::dem::test {

/// One parameter, c, with null 0 (adds) or 1 (scales) unless the formula says otherwise.
inline UserEffect Formula(const std::string& target, const std::string& formula,
                          FormulaAction action = FormulaAction::kAdds,
                          std::vector<std::string> parameters = {"c"}) {
  UserEffect effect;
  effect.info.name = "mine";
  effect.info.kind = KindOfTarget(target);
  effect.action = action;
  effect.target = target;
  effect.formula = formula;
  for (const std::string& name : parameters) {
    ParameterInfo info;
    info.name = name;
    info.min = -1e300;
    info.max = 1e300;
    info.null_value = 0;
    info.default_prior = {.kind = "uniform", .min = 0, .max = 1};
    effect.info.parameters.push_back(info);
  }
  return effect;
}

/// The model joined by it, with a value for each of its parameters in order.
inline Model Joined(Model model, UserEffect effect, const std::vector<double>& values) {
  model.effects.push_back(effect.info.name);
  for (std::size_t i = 0; i < values.size(); ++i) {
    model.parameters[effect.info.name + "." + effect.info.parameters[i].name] = values[i];
  }
  model.user_effects.push_back(std::move(effect));
  return model;
}

}  // namespace calib::dem::test
