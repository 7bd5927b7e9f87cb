#pragma once
// The list that CMake makes of the files in dem/measure/observables (registry/found_entries.cc.in).

#include <vector>

#include "dem/model/observable.h"

namespace calib::dem {

/// The entry of each file dem/measure/observables/some_name.cc, made by its function SomeName(); in
/// no order that means anything. Every test in the periodic cell reads these observables after its
/// own.
std::vector<ObservableEntry> FoundObservables();

}  // namespace calib::dem
