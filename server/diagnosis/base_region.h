#pragma once
// Where in the base parameters a design is worth its runs: the posterior of the base model, made
// wide since a model that lacks an effect bends its parameters to hide it.

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "inference/prior/joint_prior.h"
#include "server/diagnosis/run_matrices.h"

namespace calib::diagnosis {

/// The region and points of it.
struct BaseRegion {
  BaseAxes axes{};           ///< whose box [-1, 1]^d the emulators are made for
  Eigen::MatrixXd draws{};   ///< m x d, scaled: of the tempered posterior, within the box
  Eigen::VectorXd centre{};  ///< d, scaled: mean of the draws
  double power = 0;          ///< of the likelihood in the tempered posterior, (0, 1]
  Eigen::Index nearest = 0;  ///< run of the base that is closest to the centre
};

/// By an emulator of the base runs. The likelihood is raised to 1/100, which makes a normal
/// posterior ten times as wide (as extensions start), or less, until ten base runs count; the box
/// holds four sd of that to both sides, within the range of the runs, and is the whole range where
/// too few runs would be left in it. Deterministic. Errors: FAILED_PRECONDITION for fewer than
/// FewestBaseRuns, naming both numbers, and for curves that have no more coordinates than there are
/// parameters; those of the emulator.
absl::StatusOr<BaseRegion> RegionOf(const BaseRuns& base, const inference::JointPrior& prior);

/// ln of the base parameters' prior over scaled coordinates at n x d points, n entries, up to a
/// constant.
Eigen::VectorXd LogBasePrior(const inference::JointPrior& prior, const BaseAxes& axes,
                             const Eigen::MatrixXd& scaled);

}  // namespace calib::diagnosis
