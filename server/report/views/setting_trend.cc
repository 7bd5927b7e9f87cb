#include "server/report/views/setting_trend.h"

#include <cmath>
#include <set>

namespace calib::report {
namespace {

constexpr const char* kLoadingRate = "loading_rate";  // no setting of a test: any may have one

double SettingOf(const campaign::Experiment& experiment, const std::string& name) {
  if (name == kLoadingRate) return experiment.loading_rate.value_or(0);
  const auto found = experiment.settings.find(name);
  return found == experiment.settings.end() ? 0 : found->second;
}

std::set<std::string> SettingsOf(const std::vector<ValueInExperiment>& values) {
  std::set<std::string> names;
  for (const ValueInExperiment& v : values) {
    for (const auto& [name, value] : v.experiment->settings) names.insert(name);
    if (v.experiment->loading_rate) names.insert(kLoadingRate);
  }
  return names;
}

}  // namespace

std::vector<SettingTrend> TrendsWithSettings(const std::vector<ValueInExperiment>& values) {
  constexpr double kDistinct = 1e-9;  // of the squares that make up the spread: their rounding
  std::vector<SettingTrend> trends;
  for (const std::string& name : SettingsOf(values)) {
    double sw = 0;
    double sx = 0;
    double sxx = 0;
    double sy = 0;
    double sxy = 0;
    bool all = true;
    for (const ValueInExperiment& v : values) {
      const double setting = SettingOf(*v.experiment, name);
      all = all && setting > 0;
      if (!all) break;
      const double x = std::log10(setting);
      const double w = 1 / (v.sd * v.sd);
      sw += w;
      sx += w * x;
      sxx += w * x * x;
      sy += w * v.value;
      sxy += w * x * v.value;
    }
    if (!all) continue;
    const double spread = sxx - sx * sx / sw;
    if (!(spread > kDistinct * sxx)) continue;
    trends.push_back(
        {.with = name, .per_decade = (sxy - sx * sy / sw) / spread, .sd = 1 / std::sqrt(spread)});
  }
  return trends;
}

}  // namespace calib::report
