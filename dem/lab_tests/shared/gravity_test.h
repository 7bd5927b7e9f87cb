#pragma once
// Tests of grains under gravity between walls, in real time: settings that they share.

#include <string>
#include <vector>

#include "dem/model/lab_test.h"
#include "dem/model/scenario.h"

namespace calib::dem {

/// Acceleration of free fall where a test does not set it [m/s^2]: standard gravity.
/// [3rd General Conference on Weights and Measures, 1901]
inline constexpr double kGravity = 9.80665;

/// Catalogue entry of a length, time or speed of the test's geometry in `unit`, >= 0; 0, its
/// default, lets the test choose it from the grains, as the description says.
ParameterInfo Chosen(const std::string& name, const std::string& unit,
                     const std::string& description);

/// Catalogue entry of the setting `thickness` t [m] of tests in a plane: 0 leaves spheres, more
/// makes disks of their radii, m = pi r^2 t rho, I = m r^2/2.
ParameterInfo ThicknessOfDisks();

/// Default and range of a setting, in its SI unit.
struct SettingRange {
  double value = 0;
  double min = 0;
  double max = 0;
};
/// Catalogue entry of a setting in `unit`.
ParameterInfo Setting(const std::string& name, const std::string& unit, const SettingRange& range,
                      const std::string& description);

/// Catalogue entry of a setting that is a whole number: a switch or a number of things.
ParameterInfo Whole(const std::string& name, const SettingRange& range,
                    const std::string& description);

/// A setting of a test under gravity that the scenario gives, or `otherwise` where it gives none
/// or 0, which lets the test choose [SI].
double GivenSetting(const Scenario& scenario, const std::string& name, double otherwise = 0);

/// A length that the user may give, and what has to pass it.
struct Passage {
  std::string setting{};  ///< its name
  std::string grains{};   ///< what has to pass, "the largest grain"
  double least = 0;       ///< size of that [m]
  std::string why{};      ///< what follows where it does not, "it does not fit into the box"
};
/// "SETTING is 0.01 m, GRAINS 0.02 m: WHY" where the length that the scenario gives is no more than
/// what has to pass; empty otherwise, and where it gives none.
std::string NarrowProblem(const Scenario& scenario, const Passage& passage);

/// The settings that every test under gravity has, gravity [m/s^2], local_damping [-] and drag
/// [1/s], followed by `own`.
std::vector<ParameterInfo> WithCommonSettings(std::vector<ParameterInfo> own);

}  // namespace calib::dem
