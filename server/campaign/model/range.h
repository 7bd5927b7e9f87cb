#pragma once
// Which values a number may have.

#include <limits>
#include <string>

#include "dem/registry/catalog.h"

namespace calib::campaign {

/// An interval of admissible values.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_open = false;
  bool max_open = false;
  bool infinite_allowed = false;  ///< an infinite value is admissible where max is infinite

  bool Contains(double value) const;
  /// "greater than 0", "between 0 and 0.5", ...; unit is appended unless "1".
  std::string Describe(const std::string& unit = "1") const;
};
inline constexpr Range kPositive{.min = 0, .min_open = true};

/// The values that the catalogue allows a parameter, in its SI unit; infinite ones where the
/// catalogue has no bound.
inline Range AdmissibleRange(const dem::ParameterInfo& info) {
  return {.min = info.min, .max = info.max, .min_open = info.min_open, .infinite_allowed = true};
}

}  // namespace calib::campaign
