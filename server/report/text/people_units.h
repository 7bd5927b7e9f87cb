#pragma once
// Units and numbers as people like to read them: MPa instead of 1e6 Pa, percent for strains,
// degrees for angles.

#include <cstdint>
#include <map>
#include <string>

namespace calib::report {

/// shown = value [SI] * factor; label is empty for plain numbers.
struct DisplayUnit {
  double factor = 1;
  std::string label;
};

/// The unit in which a quantity of this size is shown. name decides where the SI unit alone does
/// not (strains are "1").
DisplayUnit UnitForPeople(const std::string& name, const std::string& si_unit, double largest);

/// "volumetric strain" for "volumetric_strain"; "rolling resistance: friction" for
/// "rolling_resistance.friction".
std::string NameForPeople(const std::string& name);

/// `digits` significant digits without trailing zeros, no exponent between 1e-3 and 1e6; "–" for
/// NaN.
std::string Number(double value, int digits = 4);

/// "2026-11-23 03:46 UTC".
std::string DateForPeople(std::int64_t unix_ms);

/// A share in percent: "4.1 %"; "–" for NaN.
std::string Percent(double share, int digits);
/// A probability in whole percent; of what is not certain nothing is said to be: "more than 99 %".
std::string ChanceInWords(double probability);
/// Percent with two digits, "< 0.1 %" where less is chance.
std::string ShareExplained(double share);

/// Number with its display unit: "4.1 GPa".
std::string NumberWithUnit(double value, const std::string& name, const std::string& si_unit,
                           int digits = 4);

/// "stiffness = 8.2 kN m/rad, friction = 0.1", in the units given by dotted parameter.
std::string StrengthInWords(const std::map<std::string, double>& amplitude,
                            const std::map<std::string, std::string>& units);

/// "1 h 20 min", "35 s".
std::string Duration(double seconds);

}  // namespace calib::report
