#pragma once
// Where contact laws, effects, lab tests and observables are listed, for everything that reads the
// catalogue and for the engine. Contact laws, effects, tests and further observables of the cell
// are found by their files, one each. Thread-safe; entries live as long as the program.

#include <span>
#include <string>

#include "dem/dynamics/contact_model.h"
#include "dem/model/contact_law.h"
#include "dem/model/effect.h"
#include "dem/model/model_entries.h"
#include "dem/model/observable.h"
#include "dem/model/test_entry.h"

namespace calib::dem {

/// Every contact law of dem/contact/laws, in the order of their places.
std::span<const ContactEntry> ContactEntries();

/// Every effect of dem/effects, in the order of their places.
std::span<const EffectEntry> EffectEntries();

/// Every test of dem/lab_tests, in the order of their places.
std::span<const TestEntry> TestEntries();

/// The test of this name, or nullptr.
const TestEntry* FindTestEntry(const std::string& name);

/// What the names of the model stand for. Precondition: the build has its contact law.
ModelEntries EntriesOf(const Model& model);

/// The chain of kernels of a model by its names. Precondition: ScenarioProblems() finds nothing
/// wrong with the model. thickness: of disks [m]; 0: the grains are spheres.
ContactModel ContactModelOf(const Model& model, double thickness = 0);

}  // namespace calib::dem
