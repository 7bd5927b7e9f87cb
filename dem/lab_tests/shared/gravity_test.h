#pragma once
// Tests of grains under gravity between walls, in real time: settings that they share.

#include <string>
#include <vector>

#include "dem/model/lab_test.h"

namespace calib::dem {

/// Acceleration of free fall where a test does not set it [m/s^2].
inline constexpr double kGravity = 9.80665;

/// A length, time or speed of the test's geometry in `unit`, >= 0; 0, its default, lets the test
/// choose it from the grains, as the description says.
ParameterInfo Chosen(const std::string& name, const std::string& unit,
                     const std::string& description);

/// `thickness` of tests in a plane: 0 leaves spheres, more makes disks of their radii,
/// m = pi r^2 t rho, I = m r^2/2.
ParameterInfo ThicknessOfDisks();

/// A setting with a default of its own, in [min, max].
struct SettingRange {
  double value = 0;
  double min = 0;
  double max = 0;
};
ParameterInfo Setting(const std::string& name, const std::string& unit, const SettingRange& range,
                      const std::string& description);

/// A switch or a number of things.
ParameterInfo Whole(const std::string& name, const SettingRange& range,
                    const std::string& description);

/// The settings given, after gravity [m/s^2], local_damping [-] and drag [1/s], which every test
/// has.
std::vector<ParameterInfo> WithCommonSettings(std::vector<ParameterInfo> own);

}  // namespace calib::dem
