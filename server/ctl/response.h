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
#include "server/report/run_table.h"

namespace calib::ctl {

struct Response {
  inference::FittedModel model;
  Eigen::MatrixXd points;     ///< G x d, SI: where model.histories were predicted
  double emulator_error = 0;  ///< of a run predicted from the others, noise sd
  double scatter = 0;         ///< noise sd
  /// The emulator predicts runs well enough to judge by: what it does not know of them beyond their
  /// scatter would otherwise excuse any misfit.
  bool trustworthy = false;
  /// T x T, of the difference between a measurement and one run of the model at the right point:
  /// noise, nuisance, and the scatter of both.
  Eigen::MatrixXd run_covariance{};
  /// Of each reading: its experiment, or its stage of loading where only one experiment is fitted.
  std::vector<int> parts{};
};

/// nuisance: directions (T each) that a measurement may differ by for numerical reasons; they join
/// the covariance with unit variance. Errors: FAILED_PRECONDITION when the runs cannot be emulated.
/// further: runs in addition to the campaign's own, parameters in its order.
absl::StatusOr<Response> RespondTo(const report::CampaignView& view,
                                   const std::vector<Eigen::VectorXd>& nuisance,
                                   const report::RunTable& further = {});

/// Runs of the model without the effects that `extended` has on top, as runs of `extended`: where a
/// parameter of an effect has its null value the others do not matter, so that they are spread over
/// their priors. Runs that cannot be expressed so are left out.
report::RunTable RunsWithoutEffect(const report::RunTable& without,
                                   const campaign::Campaign& parent,
                                   const campaign::Campaign& extended);

}  // namespace calib::ctl
