#pragma once
// What an emulator of runs says of one of their outputs: which parameters move it, and how it goes
// with them.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/numerics/gaussian_process.h"
#include "inference/prior/joint_prior.h"
#include "inference/sensitivity/sobol_indices.h"

namespace calib::inference {

/// An output of a model that was run N times, emulated.
struct OutputSensitivity {
  /// Over the prior; empty where none were asked for, the prior's parameters are not independent,
  /// nothing is explained or the points are out of reach.
  SobolIndices indices;
  /// 1 - mean square leave-one-out error / variance of the runs; NaN where all runs are equal.
  double explained = 0;
  double mean = 0;  ///< of the emulated output over the points
  double sd = 0;    ///< likewise, and the emulator's leave-one-out error in quadrature
  /// d, of the output's rank with each parameter's, over the points; empty where nothing is
  /// explained or the points are out of reach, NaN for a parameter that does not vary over them.
  Eigen::VectorXd correlation;
  Eigen::VectorXd correlation_error;  ///< d
  /// Nine tenths of the points spread, in some parameter, over more than twice the range of the
  /// runs: what the emulator says there is its trend, of which no run knows.
  bool out_of_reach = false;

  /// Whether the emulator tells enough of the output to say what moves it.
  bool Explains() const;
};

/// Share of the runs' variance below which an emulator explains nothing.
constexpr double kLeastExplained = 0.05;

struct SensitivityOptions {
  SobolOptions sobol;
  int max_runs = 120;  ///< that the emulator learns from, evenly chosen, >= 20
  int folds = 8;  ///< parts of the runs left out in turn for the emulator's share of errors, >= 2
};

/// Points over which outputs are looked at, e.g. draws of the posterior.
struct RankedPoints {
  Eigen::MatrixXd standard;            ///< m x d, JointPrior::ToStandard()
  std::vector<Eigen::VectorXd> ranks;  ///< m, of each parameter; ties share theirs
  double effective = 0;  ///< m^2 over the sum of squares of how often each row stands there
};

/// points: m x d, m >= 3.
RankedPoints Ranked(const JointPrior& priors, const Eigen::MatrixXd& points);

/// Gaussian processes in standardised parameters of one output: of all runs, and of all but each of
/// `folds` parts of them. Immutable.
class EmulatedOutput {
 public:
  /// parameters: N x d, outputs: N, finite. Errors: INVALID_ARGUMENT for shapes; FAILED_PRECONDITION
  /// with fewer than max(20, 3 d) runs.
  static absl::StatusOr<EmulatedOutput> Fit(const JointPrior& priors,
                                            const Eigen::MatrixXd& parameters,
                                            const Eigen::VectorXd& outputs,
                                            const SensitivityOptions& options);

  /// Over the points, with indices from SobolSets() where there are any. Errors join the sampling's
  /// and the emulator's: the latter by a jackknife over the parts of the runs [Efron & Tibshirani
  /// 1993, ch. 11]; a part whose emulator is constant says that nothing moves the output, 0.
  OutputSensitivity Over(const JointPrior& priors, const RankedPoints& points,
                         std::span<const Eigen::MatrixXd> sets) const;

  double explained() const { return explained_; }

 private:
  explicit EmulatedOutput(GaussianProcess whole) : whole_(std::move(whole)) {}

  GaussianProcess whole_;
  std::vector<GaussianProcess> parts_;  // empty where nothing is explained
  Eigen::RowVectorXd range_;            // of the runs, standardised
  double missed_ = 0;                   // mean square leave-one-out error
  double explained_ = 0;
};

/// Of each column of outputs (N x k) over points (m x d), with indices.
absl::StatusOr<std::vector<OutputSensitivity>> AnalyseSensitivity(
    const JointPrior& priors, const Eigen::MatrixXd& parameters, const Eigen::MatrixXd& outputs,
    const Eigen::MatrixXd& points, const SensitivityOptions& options);

}  // namespace calib::inference
