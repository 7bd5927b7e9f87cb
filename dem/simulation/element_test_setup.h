#pragma once
// What is known of an element test before its grains move: its entry and what effects ask.

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

Alterations AlterationsOf(const Scenario& scenario);

}  // namespace calib::dem
