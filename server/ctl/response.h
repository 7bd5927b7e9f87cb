#pragma once
// A finished campaign as the statistics of the diagnosis see it: an emulator of its runs, spread
// out over the prior and the posterior.

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/diagnosis/screen.h"
#include "server/report/campaign_view.h"

namespace calib::ctl {

/// Predictions of the readings by the finished samples, in noise units about the measurement.
struct RunTable {
  std::vector<int> sample;     ///< numbers, ascending
  Eigen::MatrixXd parameters;  ///< N x d, SI
  Eigen::MatrixXd histories;   ///< N x T, (prediction - reading) / sd
};
RunTable RunsOf(const report::CampaignView& view);

struct Response {
  inference::FittedModel model;
  Eigen::MatrixXd points;       ///< G x d, SI: where model.histories were predicted
  double emulator_error = 0;    ///< of a run predicted from the others, noise sd
  double scatter = 0;           ///< noise sd
};

/// nuisance: directions (T each) that a measurement may differ by for numerical reasons; they join
/// the covariance with unit variance. Errors: FAILED_PRECONDITION when the runs cannot be emulated.
absl::StatusOr<Response> RespondTo(const report::CampaignView& view,
                                   const std::vector<Eigen::VectorXd>& nuisance);

}  // namespace calib::ctl
