#include "server/campaign/checks/control_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "dem/model/readings.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/test_start.h"

namespace calib::campaign {
namespace {

/// Difference to the stress of the start, over the largest, within which nothing is loaded yet [-].
/// Chosen: gauges and controllers of pressure are as good.
constexpr double kUnloaded = 0.02;
/// Turning points over readings from which the order of rows is doubted [-]. Chosen: a stage that
/// was measured has three readings.
constexpr double kTurningShare = 1.0 / 3;
constexpr int kFewestToJudgeOrder = 5;  // readings

// Whether the first stresses are those that the test begins with; empty: none was read that says.
std::optional<bool> BeginsUnloaded(const Experiment& experiment) {
  const auto start_of_test = KnownStartOf(experiment);
  constexpr std::array kResists = {"axial_stress", "mean_stress",  "stress_ratio",
                                   "q_over_p",     "shear_stress", "deviatoric_stress"};
  std::optional<bool> unloaded;
  for (const MeasuredObservable& observable : experiment.observables) {
    if (!start_of_test || observable.values.empty() || !std::isfinite(observable.values.front()) ||
        std::find(kResists.begin(), kResists.end(), observable.name) == kResists.end()) {
      continue;
    }
    double dem::Measurement::*const member = dem::MemberNamed(observable.name);
    if (member == nullptr) continue;
    const double start = (*start_of_test).*member;
    const double size = LargestSizeOf(observable.values);
    const double allowed = std::max(kErrors * SdAt(observable, 0), kUnloaded * size);
    unloaded = unloaded.value_or(true) && std::abs(observable.values.front() - start) <= allowed;
  }
  return unloaded;
}

// From its first reading the control goes back to the start of the test and on.
bool GoesBackThroughStart(const Experiment& experiment) {
  const double first = experiment.control.front() - experiment.control_start;
  for (const double control : experiment.control) {
    const double away = control - experiment.control_start;
    if (std::abs(away) > std::abs(first)) return away * first < 0;
  }
  return false;
}

void CheckOrder(const Experiment& experiment, std::vector<Warning>& warnings) {
  const dem::TestInfo* test = dem::FindTest(experiment.test);
  if (test != nullptr && test->separate_points) return;
  const auto n = static_cast<int>(experiment.control.size());
  const std::string& name = experiment.control_name;
  const int turning = TurningPointsOf(experiment);
  if (n >= kFewestToJudgeOrder && turning > kTurningShare * n) {
    warnings.push_back(
        {WarningKind::kPathOrder, experiment.name, name,
         absl::StrCat("turns back at ", turning, " of ", n,
                      " readings: are the rows in the order in which they were measured?")});
    return;
  }
  const double first = std::abs(experiment.control.front() - experiment.control_start);
  const double last = std::abs(experiment.control.back() - experiment.control_start);
  constexpr double kFar = 0.9;    // of the way, Chosen: the file begins where the test ends
  constexpr double kClose = 0.1;  // of the way, Chosen: and ends where it begins
  if (n > 2 && first > kFar * WayOf(experiment) && last < kClose * WayOf(experiment) &&
      turning <= 1) {
    warnings.push_back({WarningKind::kPathOrder, experiment.name, name,
                        absl::StrCat("begins at ", InWords(name, experiment.control.front()),
                                     " and ends at ", InWords(name, experiment.control.back()),
                                     ": the rows seem to stand in reversed order")});
  }
}

// A first strain behind the start, or one at which nothing is loaded yet, is the gauge's.
void CheckZeroOfControl(const Experiment& experiment, std::vector<Warning>& warnings) {
  const std::string& name = experiment.control_name;
  const double first = experiment.control.front() - experiment.control_start;
  if (!name.ends_with("_strain") || std::abs(first) <= kAtStart * WayOf(experiment)) return;
  const std::optional<bool> unloaded = BeginsUnloaded(experiment);
  const bool behind = GoesBackThroughStart(experiment);
  if (behind && unloaded.value_or(true)) {
    warnings.push_back(
        {WarningKind::kOffset, experiment.name, name,
         absl::StrCat("begins at ", InWords(name, first),
                      ", before the test does, and then goes the other way: an offset of the "
                      "gauge? zero: first or offset: {",
                      name, ": ...} takes it off every reading")});
  } else if (std::abs(first) > kSeatingStrain * WayOf(experiment) && unloaded.value_or(false)) {
    warnings.push_back(
        {WarningKind::kOffset, experiment.name, name,
         absl::StrCat("begins at ", InWords(name, first),
                      ", where the stresses are still those that the test begins with: an "
                      "offset of the gauge? zero: first or offset: {",
                      name, ": ...} takes it off every reading")});
  }
}

}  // namespace

std::vector<Warning> ControlWarnings(const Experiment& experiment) {
  std::vector<Warning> warnings;
  if (experiment.control.empty() || experiment.control_name.empty()) return warnings;
  CheckOrder(experiment, warnings);
  CheckZeroOfControl(experiment, warnings);
  return warnings;
}

int TurningPointsOf(const Experiment& experiment) {
  int turning = 0;
  int direction = 0;
  double at = experiment.control_start;
  for (const dem::ControlPoint& point : experiment.path) {
    const int now = point.target > at ? 1 : (point.target < at ? -1 : direction);
    if (direction != 0 && now != direction) ++turning;
    direction = now;
    at = point.target;
  }
  return turning;
}

}  // namespace calib::campaign
