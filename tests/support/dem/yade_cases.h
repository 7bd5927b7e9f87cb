#pragma once
// The known-truth cases computed with YADE and our runs with the same staging.

#include <cstdlib>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "dem/registry/catalog.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem::test {

inline std::string DataFolder() {
  const char* folder = std::getenv("CALIB_DATA");
  return folder == nullptr ? "" : folder;
}

/// Columns by name of a comma-separated file, rows of stage `iso` left out.
inline std::map<std::string, std::vector<double>> ReadCase(const std::string& path) {
  std::istringstream text(ReadFile(path));
  std::string line;
  std::getline(text, line);
  std::vector<std::string> names;
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) {
    names.push_back(name);
  }
  std::map<std::string, std::vector<double>> columns;
  while (std::getline(text, line)) {
    std::istringstream fields(line);
    std::string field;
    std::getline(fields, field, ',');
    if (field == "iso") {
      continue;
    }
    for (std::size_t c = 1; c < names.size() && std::getline(fields, field, ','); ++c) {
      columns[names[c]].push_back(std::strtod(field.c_str(), nullptr));
    }
  }
  return columns;
}

inline Model CaseModel(const std::string& name) {
  Model model;
  model.contact = name == "linear" ? "linear" : "hertz_mindlin";
  model.density = 2650e3;
  if (name == "base") {
    model.parameters = {
        {"young_modulus", 0.8e9}, {"poisson_ratio", 0.2}, {"friction_coefficient", 0.55}};
  } else if (name == "rolling") {
    model.parameters = {{"young_modulus", 1.3e9},
                        {"poisson_ratio", 0.2},
                        {"friction_coefficient", 0.35},
                        {"rolling_resistance.stiffness", 0.6},
                        {"rolling_resistance.friction", 0.08}};
    model.effects = {"rolling_resistance"};
  } else {
    model.parameters = {
        {"young_modulus", 0.12e9}, {"poisson_ratio", 0.6}, {"friction_coefficient", 0.5}};
  }
  return model;
}

/// The case's scenario, walked through the strains of the reference.
inline Scenario CaseScenario(const std::string& name, const std::string& test, double pressure,
                             const std::vector<double>& strains) {
  Scenario s;
  s.model = CaseModel(name);
  s.test = test;
  s.settings = {{"confining_pressure", pressure}};
  s.packing = LoadPacking(DataFolder() + "/toyoura_triaxial/packing_1000.txt");
  s.staging = {.rate = 0.1,
               .step = 0.002,
               .damping_loading = 0.2,
               .damping_settling = 0.9,
               .unbalanced = 5e-4};
  for (std::size_t k = 0; k < strains.size(); ++k) {
    s.path.push_back({.target = strains[k], .load_step = static_cast<int>(k)});
  }
  return s;
}

/// Repeat r of a scenario: every grain moved by up to 1e-6 m along x; repeat 0 is the scenario
/// itself.
inline Scenario Perturbed(Scenario scenario, int r) {
  std::mt19937 random(static_cast<unsigned>(r));
  std::uniform_real_distribution<double> shift(-1e-6, 1e-6);
  for (double& x : scenario.packing.x) {
    x += r > 0 ? shift(random) : 0.0;
  }
  return scenario;
}

inline double Observable(const State& state, const std::string& name) {
  const auto& names = FindTest("triaxial_drained")->observables;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (names[k] == name) {
      return state.values[k];
    }
  }
  std::abort();
}

}  // namespace calib::dem::test
