#include "server/campaign/observable_range.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"

namespace calib::campaign {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRightAngle = std::numbers::pi / 2;

struct ObservableRange {
  const char* name;
  double min, max;
  const char* allowed;
  const char* usual_mistake;  // and what to do about it; %s: the observable
};

constexpr const char* kPercent = "if the column is in percent, say so: units: {%s: percent}";
constexpr const char* kDegrees = "if the column is in degrees, say so: units: {%s: deg}";
constexpr const char* kSign =
    "compression is positive and grains carry no tension: see to its sign";

// Restitution may exceed one, where spin turns into translation or by errors of measurement, but
// not by much; void ratios of the loosest powders stay below 20 (a porosity of 0.95).
constexpr std::array kRanges = {
    ObservableRange{"porosity", 0, 1, "between 0 and 1", kPercent},
    ObservableRange{"void_ratio", 0, 20, "between 0 and 20", kPercent},
    ObservableRange{"mean_stress", 0, kInfinity, "at least 0", kSign},
    ObservableRange{"stress_ratio", 0, kInfinity, "at least 0", kSign},
    ObservableRange{"q_over_p", -1.5, 3, "between -1.5 (no axial stress) and 3 (no lateral one)",
                    kSign},
    ObservableRange{"normal_restitution", 0, 2, "between 0 and 2", kPercent},
    ObservableRange{"energy_restitution", 0, 2, "between 0 and 2", kPercent},
    ObservableRange{"impact_angle", 0, kRightAngle, "between 0 and pi/2 rad", kDegrees},
    ObservableRange{"rebound_angle", -kRightAngle, kRightAngle, "between -pi/2 and pi/2 rad",
                    kDegrees},
    ObservableRange{"angle_of_repose", 0, kRightAngle, "between 0 and pi/2 rad", kDegrees},
    ObservableRange{"angle_fluctuation", 0, kRightAngle, "between 0 and pi/2 rad", kDegrees},
    ObservableRange{"fraction_above", 0, 1, "between 0 and 1", kPercent},
};

std::string WithName(std::string advice, const std::string& name) {
  const std::size_t at = advice.find("%s");
  return at == std::string::npos ? advice : advice.replace(at, 2, name);
}

}  // namespace

void CheckRangeOf(const std::string& observable, const LaboratoryTable& table,
                  const std::vector<double>& values, ReadContext& context) {
  const auto range = std::find_if(kRanges.begin(), kRanges.end(),
                                  [&observable](const auto& r) { return observable == r.name; });
  if (range == kRanges.end()) return;
  const auto outside = [&range](double value) { return value < range->min || value > range->max; };
  const auto first = std::find_if(values.begin(), values.end(), outside);
  if (first == values.end()) return;
  const auto others = std::count_if(first + 1, values.end(), outside);
  context.problems().AddIn(
      table.path(), table.LineOf(static_cast<std::size_t>(first - values.begin())),
      table.ColumnOf(observable),
      absl::StrCat(observable, " is ", *first, " here",
                   others > 0 ? absl::StrCat(" (and impossible in ", others, " later rows)") : "",
                   "; it has to be ", range->allowed, "; ",
                   WithName(range->usual_mistake, observable)));
}

}  // namespace calib::campaign
