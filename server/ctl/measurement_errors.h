#pragma once
// What a measurement may differ by from a model that is right: noise, scatter of its packing, what
// is not known of the model, numerical nuisance. As covariances, and drawn.

#include <Eigen/Dense>
#include <vector>

#include "inference/emulator/state_emulator.h"
#include "server/ctl/fitted_campaign.h"

namespace calib::ctl {

/// Differences over the T readings, in the sd of base.readings().of_mean.
struct DrawnErrors {
  Eigen::MatrixXd covariance;  ///< T x T
  Eigen::MatrixXd draws;  ///< S x T; scatter is resampled from what the emulator misses of runs
};

struct MeasurementErrors {
  DrawnErrors of_mean;  ///< from the mean history at the right point
  DrawnErrors of_run;   ///< from a run there; drawn: from the closest of a few
  double scatter = 0;   ///< of a single run, in sd of the readings' noise alone
};

/// not_known: sd of the mean history's scores at the point judged by. nuisance: directions (T each)
/// that a measurement may differ by for numerical reasons, of unit variance. Scatter is what
/// several packings were measured to differ by, or, where packings were not varied, what the
/// emulator does not explain of single runs: few packings span few directions, and a covariance of
/// the runs on them finds a measurement on yet another one impossible
/// (deploy/bench/hidden-effects.d/README.md).
MeasurementErrors ErrorsOfMeasurements(const FittedCampaign& base,
                                       const inference::StateEmulator& emulator,
                                       const Eigen::VectorXd& not_known,
                                       const std::vector<Eigen::VectorXd>& nuisance);

}  // namespace calib::ctl
