#pragma once
// What a measurement may differ by from a model that is right: noise, scatter of its packing, what
// is not known of the model, numerical nuisance. As covariances, and drawn.

#include <Eigen/Dense>
#include <vector>

#include "inference/emulator/state_emulator.h"
#include "server/diagnosis/fitted_campaign.h"

namespace calib::diagnosis {

/// Differences over the T readings, in the sd of base.readings().of_mean.
struct DrawnErrors {
  Eigen::MatrixXd covariance;  ///< T x T
  Eigen::MatrixXd draws;     ///< S x T; scatter is resampled from what the emulator misses of runs
  std::vector<int> group{};  ///< of each draw, and
  std::vector<Eigen::MatrixXd> without{};  ///< see inference::FittedModel
};

struct MeasurementErrors {
  DrawnErrors of_mean;  ///< from the mean history at the right point
  DrawnErrors of_run;   ///< from a run there; drawn: from the closest of a few
  double scatter = 0;   ///< of a single run, in sd of the readings' noise alone
  int packings = 0;     ///< or twins that scatter was measured on, see inference::FittedModel
};

/// Packings whose runs say more of the scatter than a closed form, and without one of which enough
/// is left to judge it by.
inline constexpr int kFewestPackings = 4;

/// not_known: sd of the mean history's scores at the point judged by. nuisance: directions (T each)
/// that a measurement may differ by for numerical reasons, of unit variance. Scatter is what
/// several packings were measured to differ by, a chain along the path for each observable, and,
/// as far as their number supports it, what the emulator misses of the runs on them
/// (inference/scatter/packing_scatter.h); draws on a packing are judged by the covariance without
/// it. On one packing twins stand in for runs on several, each by itself. Where neither were run,
/// what the emulator does not explain of single runs. packing: of each run that the emulator was
/// validated on, any numbers.
MeasurementErrors ErrorsOfMeasurements(const FittedCampaign& base,
                                       const inference::StateEmulator& emulator,
                                       const Eigen::VectorXd& not_known,
                                       const std::vector<int>& packing,
                                       const std::vector<Eigen::VectorXd>& nuisance);

}  // namespace calib::diagnosis
