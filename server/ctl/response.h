#pragma once
// A finished campaign as the statistics of the diagnosis see it: an emulator of its runs, spread
// out over the prior and the posterior.

#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/diagnosis/screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/ctl/measurement_errors.h"

namespace calib::ctl {

struct Response {
  inference::FittedModel model;
  Eigen::MatrixXd points;     ///< G x d, SI: where model.histories were predicted
  double emulator_error = 0;  ///< of a run predicted from the others, in the sd of the histories
  double scatter = 0;         ///< of a single run, in sd of the readings' noise alone
  /// The emulator predicts runs well enough to judge by: what it does not know of them beyond their
  /// scatter would otherwise excuse any misfit.
  bool trustworthy = false;
  DrawnErrors of_run{};  ///< of a measurement from one run at the right point
  /// Of each reading: its experiment, or its stage of loading where only one experiment is fitted.
  std::vector<int> parts{};
};

/// nuisance: see ErrorsOfMeasurements. Errors: FAILED_PRECONDITION when the runs cannot be
/// emulated.
absl::StatusOr<Response> RespondTo(const FittedCampaign& base,
                                   const std::vector<Eigen::VectorXd>& nuisance);

}  // namespace calib::ctl
