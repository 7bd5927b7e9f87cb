#pragma once
// A model as the statistics of the diagnosis see it: an emulator of its runs, spread out over the
// prior and the posterior.

#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/diagnosis/screen.h"
#include "server/diagnosis/fitted_campaign.h"
#include "server/diagnosis/measurement_errors.h"

namespace calib::diagnosis {

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
  std::vector<Eigen::VectorXd> nuisance{};  ///< as given
};

/// A model to be emulated: that of the fitted campaign, or one that has effects more.
struct EmulatedModel {
  const campaign::Campaign& campaign;
  const report::RunTable& runs;  ///< histories in the units of the fitted campaign's
  Eigen::MatrixXd draws{};       ///< n x d, SI: of a posterior, n may be 0
  /// Points that the emulator knows less of are left out: sd of the mean history there, root mean
  /// square over the readings, in their sd.
  double most_unknown = 3;
};

/// nuisance: see ErrorsOfMeasurements. Errors: FAILED_PRECONDITION when the runs cannot be
/// emulated, or are nowhere known well enough.
absl::StatusOr<Response> RespondTo(const FittedCampaign& base, const EmulatedModel& model,
                                   const std::vector<Eigen::VectorXd>& nuisance);

/// Another calibration on the same readings, such as an extension, by the errors of `base`.
absl::StatusOr<Response> RespondTo(const FittedCampaign& base, const report::CampaignView& view,
                                   const std::vector<Eigen::VectorXd>& nuisance);

/// The model of the fitted campaign itself.
absl::StatusOr<Response> RespondTo(const FittedCampaign& base,
                                   const std::vector<Eigen::VectorXd>& nuisance);

}  // namespace calib::diagnosis
