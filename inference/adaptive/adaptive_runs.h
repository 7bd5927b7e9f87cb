#pragma once
// What an adaptive calibration knows: runs so far, and what they are held against. Plain values.

#include <Eigen/Core>
#include <vector>

#include "absl/status/status.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// How a run ended.
enum class RunEnd {
  kComplete,  ///< all coordinates are there
  kEarly,     ///< stopped or cut: the coordinates of the stages that it reached are there
  kFailed,    ///< the machine's fault, again and again
  kDiverged,  ///< the model cannot go on there
  kUnknown,   ///< lost
  kPending,   ///< none yet: under way, and nothing of it is known
};

/// What runs are held against.
struct AdaptiveProblem {
  JointPrior prior{};          ///< d >= 1 parameters
  Eigen::VectorXd measured{};  ///< q >= 1: coordinates of the readings, stage after stage
  Eigen::MatrixXd noise{};     ///< q x q: covariance of their errors, positive definite
  double share = 1;  ///< part of a run's scatter (variance) that the measurement has too, (0, 1]
  int packings = 1;  ///< that runs are spread over, >= 1

  absl::Status Validate() const;  ///< INVALID_ARGUMENT: what was found, what is allowed
};

/// N >= 0 runs in batches, in an order of the caller's choice that is always the same.
struct AdaptiveRuns {
  Eigen::MatrixXd parameters{};   ///< N x d, in the prior's units
  std::vector<int> packing{};     ///< N, [0, packings)
  std::vector<int> batch{};       ///< N, ascending from 0
  std::vector<RunEnd> end{};      ///< N
  Eigen::MatrixXd coordinates{};  ///< N x q; not finite where a run has not come to

  Eigen::Index rows() const { return parameters.rows(); }
  /// Those of batches before this one.
  AdaptiveRuns Before(int last) const;
  /// Those with these numbers, which ascend.
  AdaptiveRuns Only(const std::vector<Eigen::Index>& numbers) const;
  /// Those that are not pending.
  AdaptiveRuns Ended() const;
  /// INVALID_ARGUMENT: what does not fit the problem.
  absl::Status Validate(const AdaptiveProblem& problem) const;
};

/// The standardised coordinates of parameters (n x d).
Eigen::MatrixXd StandardRows(const JointPrior& prior, const Eigen::MatrixXd& parameters);

}  // namespace calib::inference
