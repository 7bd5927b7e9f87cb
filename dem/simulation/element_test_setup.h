#pragma once
// What is known of a test before its grains move: its entry and what effects ask.

#include <string>

#include "dem/catalog/registry.h"
#include "dem/dynamics/assembly.h"
#include "dem/measure/apparatus.h"
#include "dem/simulation/scenario.h"

namespace calib::dem {

/// Of the registry. Precondition: there is a test of this name in the periodic cell.
const ElementTestEntry& ElementTestNamed(const std::string& test);

/// What the effects of the model ask of readings and initial state.
struct Alterations {
  Apparatus apparatus;
  Preparation preparation;
};

/// Of a test in the periodic cell.
Alterations AlterationsOf(const Scenario& scenario);

/// What the effects of the model ask of the initial state alone; of any test.
Preparation PreparationOf(const Scenario& scenario);

}  // namespace calib::dem
