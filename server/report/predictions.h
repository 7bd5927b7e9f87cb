#pragma once
// The posterior propagated to the readings: mean and band of every observable of every experiment.

#include <vector>

#include "server/report/campaign_view.h"

namespace calib::report {

/// One entry per reading; NaN where no sample of positive weight has got there.
struct ObservablePrediction {
  std::vector<double> mean, q05, q95;
};

struct ExperimentPrediction {
  std::vector<ObservablePrediction> observables;  ///< in the order of the campaign's experiment
  int samples = 0;  ///< samples of positive weight that have states of this experiment
};

/// One entry per experiment of the campaign.
std::vector<ExperimentPrediction> PredictReadings(const CampaignView& view);

}  // namespace calib::report
