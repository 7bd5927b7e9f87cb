#pragma once
// The posterior propagated to the readings: mean and band of every observable of every experiment.

#include <Eigen/Core>
#include <array>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

inline constexpr std::array kBandProbabilities = {0.025, 0.25, 0.5, 0.75, 0.975};

/// One entry per reading; NaN where no run that counts has got there. Without a posterior
/// (posterior_from: none) the quantiles are NaN and the mean is that of the weighted samples.
struct ObservablePrediction {
  std::vector<double> mean, q05, q95;
  /// Of the ends of the 95 and 50 % bands and the median, in the order of kBandProbabilities, at
  /// each reading; NaN also where an older record has bands of its emulator, which lack them.
  std::array<std::vector<double>, 5> bands{};
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
