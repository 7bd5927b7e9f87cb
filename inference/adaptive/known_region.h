#pragma once
// Where the model can be run: learned from runs that came to an end and runs that did not.

#include <Eigen/Core>
#include <optional>

#include "absl/status/statusor.h"
#include "inference/adaptive/adaptive_runs.h"
#include "inference/numerics/gaussian_process.h"

namespace calib::inference {

/// Probability that a run completes or ends early, as a function of its parameters: a Gaussian
/// process of 1 and 0, squashed, Phi((m - 1/2) / sqrt(variance + scatter)).
///                             [least-squares classification: Rasmussen & Williams 2006, sec. 6.5]
/// One everywhere while fewer than two runs have failed, diverged or been lost: one may be chance.
/// Immutable; thread safety: const.
class KnownRegion {
 public:
  /// Deterministic. Errors: of GaussianProcess::Fit.
  static absl::StatusOr<KnownRegion> Fit(const Eigen::MatrixXd& standard, const AdaptiveRuns& runs);
  /// ln of the probability at m standardised points, m entries, <= 0, finite.
  Eigen::VectorXd LogProbability(const Eigen::MatrixXd& standard) const;
  bool bounded() const { return process_.has_value(); }

 private:
  std::optional<GaussianProcess> process_;
};

}  // namespace calib::inference
