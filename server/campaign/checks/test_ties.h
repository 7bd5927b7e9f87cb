#pragma once
// What a test in the periodic cell ties its readings to: what it holds, and which of them are ways
// of writing the same.

#include <map>
#include <string>
#include <vector>

namespace calib::campaign {

/// The states that a specimen can come to in the test, as far as its loading says: axial and
/// lateral stress, axial and lateral strain, shear strain and stress, porosity, each free, driven
/// or held. A reading is a function of them.
///
/// Porosity is free in every test: it is tied to the strains by its start, which a model may miss.

/// Whether the test holds the observable, or gives it by its control alone, so that it tells
/// nothing of any parameter. False for tests and observables that are not known here.
bool IsHeld(const std::string& test, const std::map<std::string, double>& settings,
            const std::string& control, const std::string& observable);

/// Observables that are functions of those before them in the list, given what the test holds: of
/// each the ones that it follows from, empty for the others.
std::vector<std::vector<std::string>> WhatTheyFollowFrom(
    const std::string& test, const std::map<std::string, double>& settings,
    const std::string& control, const std::vector<std::string>& observables);

}  // namespace calib::campaign
