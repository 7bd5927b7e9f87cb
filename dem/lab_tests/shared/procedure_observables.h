#pragma once
// Observables that the procedures of tests outside the periodic cell give themselves.

#include <span>

#include "dem/model/observable.h"

namespace calib::dem {

/// In the order of their places; one line of the table for each. Thread-safe.
std::span<const ObservableEntry> ProcedureObservables();

}  // namespace calib::dem
