#pragma once
// What was read of an experiment, for its author to see at a glance whether it was read right.

#include <limits>
#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// SI; NaN where there is none.
struct ObservableSummary {
  std::string name;
  std::string unit = "1";  ///< SI
  int readings = 0;
  int missing = 0;  ///< rows without one
  double first = std::numeric_limits<double>::quiet_NaN();
  double last = std::numeric_limits<double>::quiet_NaN();
  double min = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
  double sd_min = std::numeric_limits<double>::quiet_NaN();
  double sd_max = std::numeric_limits<double>::quiet_NaN();
};

struct ExperimentSummary {
  std::string name;
  std::string control;             ///< name; empty: readings are merely counted
  std::string control_unit = "1";  ///< SI
  double from = std::numeric_limits<double>::quiet_NaN();  ///< of the path, SI
  double to = std::numeric_limits<double>::quiet_NaN();
  int turning_points = 0;
  std::vector<ObservableSummary> observables;
  int grains = 0;  ///< of the first specimen; 0: none
  /// Diameter that half of the grains by mass are smaller than [m]; NaN: no grains, or their sizes
  /// are not known here.
  double d50 = std::numeric_limits<double>::quiet_NaN();
  double porosity = std::numeric_limits<double>::quiet_NaN();  ///< of the first specimen [-]
};

ObservableSummary SummaryOf(const MeasuredObservable& observable);
ExperimentSummary SummaryOf(const Experiment& experiment);

}  // namespace calib::campaign
