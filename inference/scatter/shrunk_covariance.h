#pragma once
// Scatter of single runs as a full covariance over all readings: what is seen of it, held together
// by a closed form where runs are few.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// A covariance between what is seen and a closed form.
struct ShrunkCovariance {
  Eigen::MatrixXd covariance;  ///< T x T
  double target_weight = 1;    ///< w of the closed form, [0, 1]
};

/// (1 - w) S + w target, S the covariance of the departures of n runs: w is the share of the
/// squared distance between S and the target that is chance. Distances are Frobenius norms in
/// coordinates in which `unit` is the identity, so that readings count by their errors. Chance is
/// judged by whole groups: runs of a group share a packing and are no independent witnesses. With
/// fewer than two groups the target. Pure.
///               [Ledoit & Wolf, J. Multivariate Anal. 88 (2004) 365, there the target is identity]
/// in: departures n x T, zero mean, finite; group, n numbers of any value, equal for runs of a
///     group; target T x T, positive semidefinite; unit T x T, positive definite; one unit for all
ShrunkCovariance ShrinkCovariance(const Eigen::MatrixXd& departures, const std::vector<int>& group,
                                  const Eigen::MatrixXd& target, const Eigen::MatrixXd& unit);

}  // namespace calib::inference
