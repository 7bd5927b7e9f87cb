#include "server/campaign/checks/test_ties.h"

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "dem/registry/catalog.h"

namespace calib::campaign {
namespace {

// A state of the specimen; stresses over the confining pressure.
enum Coordinate : int {
  kAxialStress,
  kLateralStress,
  kAxialStrain,
  kLateralStrain,
  kShearStress,
  kShearStrain,
  kPorosity,
  kCoordinates
};
using State = Eigen::Matrix<double, kCoordinates, 1>;

struct ReadingOfState {
  const char* name;
  double (*value)(const State& s);
};

double MeanStressAt(const State& s) { return (s[kAxialStress] + 2 * s[kLateralStress]) / 3; }
double DeviatorAt(const State& s) { return s[kAxialStress] - s[kLateralStress]; }

// As dem/model/readings.h defines them; the pore pressure takes the total lateral stress as held.
constexpr std::array kReadings = {
    ReadingOfState{"axial_stress", [](const State& s) { return s[kAxialStress]; }},
    ReadingOfState{"lateral_stress", [](const State& s) { return s[kLateralStress]; }},
    ReadingOfState{"mean_stress", &MeanStressAt},
    ReadingOfState{"deviatoric_stress", &DeviatorAt},
    ReadingOfState{"stress_ratio",
                   [](const State& s) { return s[kAxialStress] / s[kLateralStress]; }},
    ReadingOfState{"q_over_p", [](const State& s) { return DeviatorAt(s) / MeanStressAt(s); }},
    ReadingOfState{"pore_pressure", [](const State& s) { return 1 - s[kLateralStress]; }},
    ReadingOfState{"axial_strain", [](const State& s) { return s[kAxialStrain]; }},
    ReadingOfState{"lateral_strain", [](const State& s) { return s[kLateralStrain]; }},
    ReadingOfState{"volumetric_strain",
                   [](const State& s) { return s[kAxialStrain] + 2 * s[kLateralStrain]; }},
    ReadingOfState{"shear_stress", [](const State& s) { return s[kShearStress]; }},
    ReadingOfState{"shear_stress_ratio",
                   [](const State& s) { return s[kShearStress] / s[kAxialStress]; }},
    ReadingOfState{"shear_strain", [](const State& s) { return s[kShearStrain]; }},
    ReadingOfState{"porosity", [](const State& s) { return s[kPorosity]; }},
    ReadingOfState{"void_ratio", [](const State& s) { return s[kPorosity] / (1 - s[kPorosity]); }},
};

// A state at which nothing vanishes or coincides by chance.
State Somewhere() {
  State s;
  s << 2.7, 1.1, 0.031, -0.013, 0.43, 0.021, 0.41;
  return s;
}

using Directions = std::vector<State>;  // in which the states can differ, the control kept

State Along(Coordinate coordinate) {
  State direction = State::Zero();
  direction[coordinate] = 1;
  return direction;
}

// Without those that a strain-driven test gives to all: the porosity.
std::optional<Directions> LoadingOf(const std::string& test,
                                    const std::map<std::string, double>& settings) {
  const auto constant_volume = settings.find("constant_volume");
  if (test == "triaxial_drained") return Directions{Along(kAxialStress), Along(kLateralStrain)};
  if (test == "triaxial_undrained") return Directions{Along(kAxialStress), Along(kLateralStress)};
  if (test == "oedometric") {
    const auto stress_driven = settings.find(dem::kStressDriven);
    const bool by_stress = stress_driven != settings.end() && stress_driven->second != 0;
    return Directions{Along(by_stress ? kAxialStrain : kAxialStress), Along(kLateralStress)};
  }
  if (test == "isotropic") return Directions{Along(kAxialStrain), Along(kLateralStrain)};
  if (test != "simple_shear") return std::nullopt;
  if (constant_volume != settings.end() && constant_volume->second != 0) {
    return Directions{Along(kShearStress), Along(kAxialStress), Along(kLateralStress)};
  }
  return Directions{Along(kShearStress), Along(kLateralStress), Along(kAxialStrain)};
}

std::optional<Directions> FreeIn(const std::string& test,
                                 const std::map<std::string, double>& settings,
                                 const std::string& control) {
  auto free = LoadingOf(test, settings);
  const dem::TestInfo* info = dem::FindTest(test);
  if (!free || info == nullptr || control != dem::ControlOf(*info, settings)) return std::nullopt;
  free->push_back(Along(kPorosity));
  return free;
}

// Change of a reading along each of the directions; empty: it is not known here.
std::optional<Eigen::VectorXd> ChangeOf(const std::string& observable, const Directions& free) {
  constexpr double kStep = 1e-6;
  const auto reading = std::find_if(kReadings.begin(), kReadings.end(),
                                    [&](const ReadingOfState& r) { return observable == r.name; });
  if (reading == kReadings.end()) return std::nullopt;
  Eigen::VectorXd change(static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i) {
    change[static_cast<Eigen::Index>(i)] = (reading->value(Somewhere() + kStep * free[i]) -
                                            reading->value(Somewhere() - kStep * free[i])) /
                                           (2 * kStep);
  }
  return change;
}

constexpr double kNothing = 1e-6;  // of a change of order one, well above its rounding

}  // namespace

bool IsHeld(const std::string& test, const std::map<std::string, double>& settings,
            const std::string& control, const std::string& observable) {
  const auto free = FreeIn(test, settings, control);
  if (!free) return false;
  const auto change = ChangeOf(observable, *free);
  return change && change->norm() < kNothing;
}

std::vector<std::vector<std::string>> WhatTheyFollowFrom(
    const std::string& test, const std::map<std::string, double>& settings,
    const std::string& control, const std::vector<std::string>& observables) {
  std::vector<std::vector<std::string>> ties(observables.size());
  const auto free = FreeIn(test, settings, control);
  if (!free) return ties;
  const auto n = static_cast<Eigen::Index>(free->size());
  Eigen::MatrixXd before(n, 0);
  std::vector<std::string> names;
  for (std::size_t k = 0; k < observables.size(); ++k) {
    const auto change = ChangeOf(observables[k], *free);
    if (!change || change->norm() < kNothing) continue;
    Eigen::VectorXd parts;
    if (before.cols() > 0) parts = before.colPivHouseholderQr().solve(*change);
    const bool follows =
        before.cols() > 0 && (before * parts - *change).norm() < kNothing * change->norm();
    if (!follows) {
      before.conservativeResize(n, before.cols() + 1);
      before.col(before.cols() - 1) = *change;
      names.push_back(observables[k]);
      continue;
    }
    for (Eigen::Index i = 0; i < parts.size(); ++i) {
      if (std::abs(parts[i]) > kNothing) ties[k].push_back(names[static_cast<std::size_t>(i)]);
    }
  }
  return ties;
}

}  // namespace calib::campaign
