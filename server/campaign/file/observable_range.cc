#include "server/campaign/file/observable_range.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"

namespace calib::campaign {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRightAngle = std::numbers::pi / 2;
constexpr double kErrors = 4;    // sd that a reading may be off by
constexpr double kDrift = 0.02;  // of the largest reading

struct ObservableRange {
  const char* name;
  double min, max;
  const char* allowed;
  const char* usual_mistake;  // and what to do about it; %s: the observable
};

constexpr const char* kPercent = "if the column is in percent, say so: units: {%s: percent}";
constexpr const char* kDegrees = "if the column is in degrees, say so: units: {%s: deg}";
constexpr const char* kRatio =
    "it is axial over lateral stress, compression positive: see to column and sign";
constexpr const char* kSign = "compression is positive here: see to its sign";

// Restitution may exceed one, where spin turns into translation or by errors of measurement, but
// not by much; void ratios of the loosest powders stay below 20 (a porosity of 0.95).
constexpr std::array kRanges = {
    ObservableRange{"porosity", 0, 1, "between 0 and 1", kPercent},
    ObservableRange{"void_ratio", 0, 20, "between 0 and 20", kPercent},
    ObservableRange{"mean_stress", 0, kInfinity, "at least 0", kSign},
    ObservableRange{"stress_ratio", 0, 1000, "between 0 and 1000", kRatio},
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

void CheckRangeOf(const MeasuredObservable& observable, const LaboratoryTable& table,
                  ReadContext& context) {
  const std::string& name = observable.name;
  const auto range = std::find_if(kRanges.begin(), kRanges.end(),
                                  [&name](const auto& r) { return name == r.name; });
  if (range == kRanges.end()) return;
  const std::vector<double>& values = observable.values;
  double largest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  std::vector<std::size_t> outside;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool stated = i < observable.sd.size() && std::isfinite(observable.sd[i]);
    const double slack = std::max(stated ? kErrors * observable.sd[i] : 0.0, kDrift * largest);
    if (values[i] < range->min - slack || values[i] > range->max + slack) outside.push_back(i);
  }
  // Grains that stick together can carry some tension, and zeros drift: a sign is wrong where most
  // stresses are.
  const bool is_stress = std::string_view(range->usual_mistake) == kSign;
  if (outside.empty() || (is_stress && 2 * outside.size() <= values.size())) return;
  const std::size_t others = outside.size() - 1;
  context.problems().AddIn(
      table.path(), table.LineOf(outside.front()), table.ColumnOf(name),
      absl::StrCat("is ", values[outside.front()], " here",
                   others > 0 ? absl::StrCat(" (and impossible in ", others,
                                             others == 1 ? " later row)" : " later rows)")
                              : "",
                   "; it has to be ", range->allowed, "; ", WithName(range->usual_mistake, name)));
}

}  // namespace calib::campaign
