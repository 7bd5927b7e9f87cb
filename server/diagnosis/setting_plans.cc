#include "server/diagnosis/setting_plans.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "dem/registry/catalog.h"
#include "server/diagnosis/control_way.h"

namespace calib::diagnosis {
namespace {

constexpr double kFactor = 4;
constexpr double kFactorOfFlows = 1.5;
constexpr double kTowardsLimit =
    0.9;  // of the way to where the catalogue ends; nobody measures there
constexpr std::size_t kPoints = 20;  // of a control whose values are runs of their own

double Towards(double from, double limit) {
  return std::isfinite(limit) ? from + kTowardsLimit * (limit - from) : limit;
}

const dem::ParameterInfo* FindSetting(const dem::TestInfo& test, const std::string& name) {
  const auto found = std::find_if(test.settings.begin(), test.settings.end(),
                                  [&name](const auto& s) { return s.name == name; });
  return found == test.settings.end() ? nullptr : &*found;
}

bool IsAllowed(const dem::ParameterInfo& setting, double value) {
  const bool above = setting.min_open ? value > setting.min : value >= setting.min;
  return above && value <= setting.max;
}

// What a laboratory can choose: no times at which a test ends, no numbers of the method, no depth
// of a plane model.
bool IsChosen(const dem::ParameterInfo& setting, double value) {
  static const std::set<std::string> kUnits = {"m", "m/s", "rad", "rad/s", "Pa"};
  const bool given = !setting.default_value || value != *setting.default_value;
  return given && !setting.whole && setting.name != "thickness" && kUnits.contains(setting.unit) &&
         std::isfinite(value) && value != 0;
}

class Plans {
 public:
  Plans(const campaign::Experiment& pattern, const dem::TestInfo& test)
      : pattern_(pattern), test_(test), factor_(test.poured ? kFactorOfFlows : kFactor) {}

  std::vector<PlannedExperiment> All() {
    OtherSettings();
    if (test_.separate_points || !test_.needs_packing) {  // a run for each value
      WiderRange();
      for (const std::string& control : test_.other_controls) OtherControl(control);
      if (pattern_.control_name != test_.control) OtherControl(test_.control);
    } else if (!test_.poured) {
      OtherWay();
    }
    OtherRates();
    return plans_;
  }

 private:
  bool IsStressDriven() const {
    const dem::ObservableInfo* info = dem::FindObservable(pattern_.control_name);
    return info != nullptr && info->unit == "Pa";
  }

  void OtherSettings() {
    for (const auto& [name, value] : pattern_.settings) {
      const dem::ParameterInfo* const setting = FindSetting(test_, name);
      if (setting == nullptr || name == pattern_.control_name || !IsChosen(*setting, value) ||
          (setting->unit == "Pa" && IsStressDriven())) {
        continue;
      }
      for (const double other : {value / factor_, value * factor_}) {
        if (!IsAllowed(*setting, other)) continue;
        plans_.push_back(AsMeasured(pattern_));
        plans_.back().settings[name] = other;
      }
    }
  }

  struct Reach {
    double down = 0, up = 0;      // as far as the plan would go
    double lowest = 0, most = 0;  // as far as is measured
  };
  // Values that the control may have; empty: not two of them.
  std::optional<std::array<double, 2>> Within(const std::string& control,
                                              const Reach& reach) const {
    double low = reach.down;
    double high = reach.up;
    const auto limit = [&](double min, double max) {
      low = std::max(low, std::min(reach.lowest, Towards(reach.lowest, min)));
      high = std::min(high, std::max(reach.most, Towards(reach.most, max)));
    };
    if (test_.control_range && control == test_.control) {
      limit(test_.control_range->min, test_.control_range->max);
    }
    if (const dem::ParameterInfo* setting = FindSetting(test_, control)) {
      limit(setting->min, setting->max);
    }
    if (!(low < high)) return std::nullopt;
    return std::array<double, 2>{low, high};
  }

  std::vector<double> Points(const std::array<double, 2>& range) const {
    const std::size_t measured = pattern_.control.size();
    return Spread(range[0], range[1], test_.poured ? measured : std::max(measured, kPoints));
  }

  void WiderRange() {
    const bool counts = test_.control_range && test_.control_range->whole;  // repetitions
    if (pattern_.control.empty() || counts) return;
    const auto [low, high] = std::minmax_element(pattern_.control.begin(), pattern_.control.end());
    const double down = *low > 0 ? *low / factor_ : *low * factor_;
    const double up = *high > 0 ? *high * factor_ : *high / factor_;
    const auto range =
        Within(pattern_.control_name, {.down = down, .up = up, .lowest = *low, .most = *high});
    if (!range) return;
    plans_.push_back(AsMeasured(pattern_));
    plans_.back().path = Points(*range);
  }

  // The setting drives the test about its value; what drove it stays at the middle of its values.
  void OtherControl(const std::string& control) {
    const auto value = pattern_.settings.find(control);
    if (control == pattern_.control_name || value == pattern_.settings.end() ||
        !(value->second > 0) || pattern_.control.empty()) {
      return;
    }
    const auto range = Within(control, {.down = value->second / factor_,
                                        .up = value->second * factor_,
                                        .lowest = value->second,
                                        .most = value->second});
    if (!range) return;
    std::vector<double> values = pattern_.control;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    PlannedExperiment& planned = plans_.emplace_back(AsMeasured(pattern_));
    planned.control = control;
    planned.settings[pattern_.control_name] = *middle;
    planned.path = Points(*range);
  }

  void OtherWay() {
    if (pattern_.control.empty()) return;
    const double last = *std::max_element(pattern_.control.begin(), pattern_.control.end());
    if (IsStressDriven()) {
      plans_.push_back(AsMeasured(pattern_));
      plans_.back().path = Monotonic(pattern_.control_start, kFactor * last);
    }
    if (test_.may_reverse && std::is_sorted(pattern_.control.begin(), pattern_.control.end())) {
      plans_.push_back(AsMeasured(pattern_));
      plans_.back().path = WithUnloading(pattern_.control_start, last, kHalfWay);
      plans_.back().unloading_at =
          pattern_.control_start + kHalfWay * (last - pattern_.control_start);
    }
  }

  void OtherRates() {
    if (!pattern_.loading_rate) return;
    for (const double rate : {*pattern_.loading_rate / kFactor, *pattern_.loading_rate * kFactor}) {
      plans_.push_back(AsMeasured(pattern_));
      plans_.back().settings["loading_rate"] = rate;
    }
  }

  const campaign::Experiment& pattern_;
  const dem::TestInfo& test_;
  double factor_;
  std::vector<PlannedExperiment> plans_;
};

}  // namespace

PlannedExperiment AsMeasured(const campaign::Experiment& pattern) {
  PlannedExperiment planned;
  planned.test = pattern.test;
  planned.control = pattern.control_name;
  planned.path = pattern.control;
  return planned;
}

std::vector<PlannedExperiment> SettingPlans(const campaign::Experiment& pattern) {
  const dem::TestInfo* const test = dem::FindTest(pattern.test);
  if (test == nullptr || pattern.control_name.empty()) return {};
  return Plans(pattern, *test).All();
}

}  // namespace calib::diagnosis
