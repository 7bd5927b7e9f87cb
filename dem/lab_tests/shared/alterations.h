#pragma once
// What the effects of a model ask of readings and of the initial state.

#include "dem/model/effect.h"
#include "dem/model/lab_test.h"
#include "dem/model/model.h"
#include "dem/model/model_entries.h"
#include "dem/model/rig.h"

namespace calib::dem {

/// What the effects of a model make of apparatus and specimen.
struct Alterations {
  Apparatus apparatus;  ///< without errors where the test has no rig
  Preparation preparation;
};

/// What the effects of the model ask in this test. entries: EntriesOf(model). Pure.
Alterations AlterationsOf(const Model& model, const ModelEntries& entries, const TestInfo& test);

/// What the effects of the model ask of the initial state, whatever the test. entries:
/// EntriesOf(model). Pure.
Preparation PreparationOf(const Model& model, const ModelEntries& entries);

}  // namespace calib::dem
