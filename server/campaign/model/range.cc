#include "server/campaign/model/range.h"

#include <cmath>

#include "absl/strings/str_cat.h"

namespace calib::campaign {

bool Range::Contains(double value) const {
  if (std::isnan(value)) return false;
  if (std::isinf(value)) return infinite_allowed && value > 0 && std::isinf(max);
  return (min_open ? value > min : value >= min) && (max_open ? value < max : value <= max);
}

std::string Range::Describe(const std::string& unit) const {
  const std::string suffix = unit == "1" || unit.empty() ? "" : " " + unit;
  if (std::isinf(min) && std::isinf(max)) return "a finite number";
  if (std::isinf(max)) return absl::StrCat(min_open ? "greater than " : "at least ", min, suffix);
  if (std::isinf(min)) return absl::StrCat(max_open ? "less than " : "at most ", max, suffix);
  return absl::StrCat("between ", min, min_open ? " (excluded)" : "", " and ", max,
                      max_open ? " (excluded)" : "", suffix);
}

}  // namespace calib::campaign
