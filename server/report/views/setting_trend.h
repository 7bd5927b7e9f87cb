#pragma once
// How a value that each experiment gives goes with what differs between the experiments: the
// pressure, the rate.

#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::report {

struct ValueInExperiment {
  const campaign::Experiment* experiment = nullptr;
  double value = 0;
  double sd = 0;  ///< > 0, in the unit of the value
};

struct SettingTrend {
  std::string with;       ///< a setting of the tests (confining_pressure, ...) or loading_rate
  double per_decade = 0;  ///< change of the value per factor ten in it
  double sd = 0;          ///< standard deviation of per_decade
};

/// Weighted regression of the values on the logarithm of each setting that all these experiments
/// have, above zero, and that differs between two of them; in the order of the names.
std::vector<SettingTrend> TrendsWithSettings(const std::vector<ValueInExperiment>& values);

}  // namespace calib::report
