#include "dem/lab_tests/shared/alterations.h"

#include "dem/model/parameter_set.h"

namespace calib::dem {
namespace {

ParameterSet ParametersOf(const Model& model, const EffectEntry& effect) {
  return ResolveParameters(effect.info.parameters, effect.info.name + ".", model.parameters);
}

}  // namespace

Alterations AlterationsOf(const Model& model, const ModelEntries& entries, const TestInfo& test) {
  Alterations result{.apparatus = {}, .preparation = PreparationOf(model, entries)};
  if (test.rig_load == RigLoad::kNone) {
    return result;
  }
  for (const EffectEntry* effect : entries.effects) {
    if (effect->alter != nullptr) {
      effect->alter(ParametersOf(model, *effect), result.apparatus);
    }
  }
  return result;
}

Preparation PreparationOf(const Model& model, const ModelEntries& entries) {
  Preparation result;
  for (const EffectEntry* effect : entries.effects) {
    if (effect->prepare != nullptr) {
      effect->prepare(ParametersOf(model, *effect), result);
    }
  }
  return result;
}

}  // namespace calib::dem
