#pragma once
// Scatter of single runs as a full covariance over all readings: what is seen of it, held together
// by a closed form where runs are few.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

struct ShrunkCovariance {
  Eigen::MatrixXd covariance;  ///< T x T
  double target_weight = 1;    ///< of the closed form, [0, 1]
};

/// (1 - w) S + w target, S the covariance of the departures [Ledoit & Wolf, J. Multivariate Anal.
/// 88 (2004) 365, with a target that is not the identity]: w is the share of the squared distance
/// between S and the target that is chance. Distances are Frobenius norms where `unit` is the
/// identity, so that readings count by their errors. Chance is judged by whole groups: runs of a
/// group share a packing and are no independent witnesses.
/// in: departures n x T, zero mean, finite; group, n numbers of any value; target, unit: T x T,
///     positive semidefinite and definite, same units
/// With fewer than two groups the target.
ShrunkCovariance ShrinkCovariance(const Eigen::MatrixXd& departures, const std::vector<int>& group,
                                  const Eigen::MatrixXd& target, const Eigen::MatrixXd& unit);

}  // namespace calib::inference
