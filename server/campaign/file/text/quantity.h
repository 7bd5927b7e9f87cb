#pragma once
// Numbers with units as users write them ("0.2 MPa", "45 deg", "0.1 percent", "2.65 g/cm^3") to SI
// doubles. The only place of the program where units are converted.

#include <string>

#include "absl/status/statusor.h"

namespace calib::campaign {

/// Exponents of the base units; angles count as a dimension of their own.
struct Dimension {
  double kilogram = 0, metre = 0, second = 0, radian = 0;
};

/// value [SI] = factor * value [unit].
struct Unit {
  double factor = 1;
  Dimension dimension;
};

/// A product of units: "MPa", "kg/m^3", "N m/rad", "N*m", "1/s", "m3", "percent", "" or "1" (a
/// plain number). Names take SI prefixes (nN, kPa, um). INVALID_ARGUMENT: no such unit (one
/// sentence with the nearest one).
absl::StatusOr<Unit> ParseUnit(const std::string& text);

/// Whether both measure the same thing. Radians beside other units do not count: "N m" is
/// "N m/rad".
bool SameKind(const Dimension& a, const Dimension& b);

/// The SI unit of a dimension by its usual name ("Pa", "kg/m^3"), else a product of base units
/// ("kg^2 m").
std::string SiName(const Dimension& dimension);

/// What a unit measures and how it may be written: "a pressure (Pa, kPa, MPa, GPa)".
std::string KindOfUnit(const std::string& unit);

/// A number and the unit behind it, as written; unit is empty for a plain number. "inf" and ".inf"
/// are numbers, NaN is not.
struct Quantity {
  double value = 0;
  std::string unit;
};
absl::StatusOr<Quantity> SplitQuantity(const std::string& text);

/// Number in SI; a plain number is SI already. si_unit: the unit wanted, "1" for dimensionless.
/// INVALID_ARGUMENT, one sentence: not a number, unknown unit, or a unit of another kind ("deg is
/// an angle, expected a pressure (Pa, kPa, MPa, GPa)").
absl::StatusOr<double> ParseQuantity(const std::string& text, const std::string& si_unit);

}  // namespace calib::campaign
