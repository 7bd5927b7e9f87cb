#pragma once
// The lists that CMake makes of the files in dem/effects, dem/contact/laws and dem/lab_tests
// (found_entries.cc.in).

#include <vector>

#include "dem/model/contact_law.h"
#include "dem/model/effect.h"
#include "dem/model/test_entry.h"

namespace calib::dem {

/// The entry of each file some_name.cc of dem/effects, made by its function SomeName(); in no order
/// that means anything.
std::vector<EffectEntry> FoundEffects();

/// The entry of each file some_name.cc of dem/contact/laws, made by its function SomeName(); in no
/// order that means anything.
std::vector<ContactEntry> FoundContacts();

/// The entry of each file some_name.cc of dem/lab_tests, made by its function SomeName(); in no
/// order that means anything.
std::vector<TestEntry> FoundTests();

}  // namespace calib::dem
