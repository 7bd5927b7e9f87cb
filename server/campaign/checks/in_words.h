#pragma once
// Numbers in the units that people measure in, for sentences.

#include <string>

namespace calib::campaign {

/// A value of an observable in the unit that people read it in.
struct PeoplesUnit {
  double factor = 1;  ///< value [unit] = factor * value [SI]
  std::string label;  ///< "kPa", "percent"; "1" for plain numbers
};

/// Of an observable (or setting) whose values are at most `largest` in size, SI: Pa, kPa or MPa for
/// stresses, percent for strains, degrees, millimetres; else its SI unit.
PeoplesUnit PeoplesUnitOf(const std::string& name, double largest);

/// "200 kPa", "-0.01 percent", "1.7": four digits.
std::string InWords(const std::string& name, double value);

}  // namespace calib::campaign
