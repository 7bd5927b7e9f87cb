#pragma once
// Observables that the procedures of tests outside the periodic cell give themselves.

#include <span>

#include "dem/model/observable.h"

namespace calib::dem {

/// All of them, in the order of their places. They live as long as the program; thread-safe.
std::span<const ObservableEntry> ProcedureObservables();

}  // namespace calib::dem
