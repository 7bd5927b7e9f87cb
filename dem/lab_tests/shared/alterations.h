#pragma once
// What the effects of a model ask of readings and of the initial state.

#include "dem/model/effect.h"
#include "dem/model/lab_test.h"
#include "dem/model/model.h"
#include "dem/model/model_entries.h"
#include "dem/model/rig.h"

namespace calib::dem {

struct Alterations {
  Apparatus apparatus;  ///< as it is made where the test has no rig
  Preparation preparation;
};

/// entries: of the model.
Alterations AlterationsOf(const Model& model, const ModelEntries& entries, const TestInfo& test);

/// What the effects of the model ask of the initial state alone; of any test.
Preparation PreparationOf(const Model& model, const ModelEntries& entries);

}  // namespace calib::dem
