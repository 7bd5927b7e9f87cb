#pragma once
// A campaign as curves: what was measured, what the model makes of it over the posterior, and
// single runs.

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"
#include "server/report/views/predictions.h"

namespace calib::report {

/// One entry per reading of the experiment, SI; NaN where it is missing or not known.
struct ObservableCurves {
  std::string name, unit;
  std::vector<double> values, sd;  ///< as measured, and by its stated errors
  std::vector<double> total_sd;  ///< of noise and packing scatter together; sd where none is known
  ObservablePrediction prediction{};        ///< all NaN: no posterior yet
  std::vector<double> residual{};           ///< (mean of the model - values) / total_sd
  std::vector<std::vector<double>> runs{};  ///< of each of the experiment's runs
};

/// A run that is drawn.
struct DrawnRun {
  int sample = 0;
  std::string status{};
  std::optional<int> rank{};  ///< 1: the most likely of those that have finished; empty: has not
  double weight = 0, log_likelihood = 0;  ///< NaN: not known
};

struct ExperimentCurves {
  std::string experiment, test;
  bool heldout = false;
  struct Setting {
    double value = 0;  ///< SI
    std::string unit{};
  };
  std::map<std::string, Setting> settings{};
  std::string control, control_unit;  ///< empty: readings are merely counted
  std::vector<double> control_values{};
  std::vector<std::string> segments{};  ///< loading stage of each reading
  std::vector<DrawnRun> runs{};
  std::vector<ObservableCurves> observables{};
};

/// The runs that are drawn: of those that have finished the most likely, the same for every
/// experiment, and the last of those that were stopped or are under way.
std::vector<DrawnRun> RunsToDraw(const std::vector<v1::Sample>& samples);

/// view: of `states` those of the runs that are drawn are needed, and of all for predictions.
/// predictions: of PredictReadings(); none: nothing is known yet.
std::vector<ExperimentCurves> Curves(const CampaignView& view,
                                     const std::vector<ExperimentPrediction>& predictions);

}  // namespace calib::report
