#pragma once
// The finished runs of a campaign as matrices, the way the inference and the diagnosis see them.

#include <Eigen/Dense>
#include <vector>

#include "inference/data/data_set.h"
#include "server/report/campaign_view.h"

namespace calib::report {

/// Predictions of the readings of the calibrated experiments by the finished samples.
struct RunTable {
  std::vector<int> sample;     ///< numbers, ascending
  Eigen::MatrixXd parameters;  ///< N x d, SI
  Eigen::MatrixXd histories;   ///< N x T, (prediction - reading) / sd, in the order of MakeDataSet
};

/// Samples that did not get to the last reading of every calibrated experiment are left out.
RunTable RunsOf(const CampaignView& view);

}  // namespace calib::report
