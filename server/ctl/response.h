#pragma once
// A finished campaign as the statistics of the diagnosis see it: an emulator of its runs, spread
// out over the prior and the posterior.

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/diagnosis/screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/report/campaign_view.h"
#include "server/report/run_table.h"

namespace calib::ctl {

struct Response {
  inference::FittedModel model;
  Eigen::MatrixXd points;     ///< G x d, SI: where model.histories were predicted
  double emulator_error = 0;  ///< of a run predicted from the others, in the sd of the histories
  double scatter = 0;         ///< of a single run, in sd of the readings' noise alone
  /// The emulator predicts runs well enough to judge by: what it does not know of them beyond their
  /// scatter would otherwise excuse any misfit.
  bool trustworthy = false;
  /// T x T, of the difference between a measurement and one run of the model at the right point:
  /// noise, nuisance, and the scatter of both.
  Eigen::MatrixXd run_covariance{};
  /// S x T, such differences, drawn; those of the mean history are model.draws. Scatter is
  /// resampled from what an emulator of the other runs misses of each.
  Eigen::MatrixXd run_draws{};
  /// Of each reading: its experiment, or its stage of loading where only one experiment is fitted.
  std::vector<int> parts{};
};

/// nuisance: directions (T each) that a measurement may differ by for numerical reasons; they join
/// the covariance with unit variance. Histories are in the sd of base.readings().of_mean. Scatter
/// is what several packings were measured to differ by, or, where packings were not varied, what
/// the emulator does not explain of single runs: few packings span few directions, a covariance of
/// the runs on them finds a measurement on yet another one impossible (five of five such
/// measurements without a hidden effect: chi-squared 1.4 to 2.5 per degree of freedom). Errors:
/// FAILED_PRECONDITION when the runs cannot be emulated.
absl::StatusOr<Response> RespondTo(const FittedCampaign& base,
                                   const std::vector<Eigen::VectorXd>& nuisance);

/// Runs of the model without the effects that `extended` has on top, as runs of `extended`: where a
/// parameter of an effect has its null value the others do not matter, so that they are spread over
/// their priors. Runs that cannot be expressed so are left out.
report::RunTable RunsWithoutEffect(const report::RunTable& without,
                                   const campaign::Campaign& parent,
                                   const campaign::Campaign& extended);

}  // namespace calib::ctl
