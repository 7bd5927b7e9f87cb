#pragma once
// The posterior propagated to the readings: mean and band of every observable of every experiment.

#include <Eigen/Core>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

/// One entry per reading; NaN where no run that counts has got there. Without a posterior
/// (posterior_from: none) the quantiles are NaN and the mean is that of the weighted samples.
struct ObservablePrediction {
  std::vector<double> mean, q05, q95;
  /// For held-out experiments the covariance of single runs at draws from the posterior, readings x
  /// readings, SI. Empty: no posterior, or no two runs that have reached every reading.
  Eigen::MatrixXd of_runs{};
  double runs = 0;  ///< effective number of these runs, 1 / sum of squared weights
};

struct ExperimentPrediction {
  std::vector<ObservablePrediction> observables;  ///< in the order of the campaign's experiment
  int samples = 0;  ///< runs of this experiment that count, or that the emulator learned from
};

/// One entry per experiment of the campaign. Posterior from an emulator: its bands for what was
/// calibrated, the runs at draws from it for what was held out.
std::vector<ExperimentPrediction> PredictReadings(const CampaignView& view);

}  // namespace calib::report
