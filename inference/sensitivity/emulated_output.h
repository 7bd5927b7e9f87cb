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

/// What moves one output of a model with d parameters, over m points such as draws of a posterior.
struct OutputSensitivity {
  /// Sobol indices over the prior; empty where none were asked for, the prior's parameters are not
  /// independent, nothing is explained or the points are out of reach.
  SobolIndices indices;
  /// 1 - mean square leave-one-out error / variance of the runs; NaN where all runs are equal.
  double explained = 0;
  double mean = 0;  ///< of the emulated output over the points
  /// Standard deviation of the emulated output over the points, the emulator's leave-one-out error
  /// in quadrature.
  double sd = 0;
  /// d: correlation of the output's rank with each parameter's rank over the points; empty where
  /// nothing is explained or the points are out of reach, NaN for a parameter that does not vary.
  Eigen::VectorXd correlation;
  Eigen::VectorXd correlation_error;  ///< d: standard errors of `correlation`
  /// Nine tenths of the points spread, in some parameter, over more than twice the range of the
  /// runs: what the emulator says there is its trend, of which no run knows.
  bool out_of_reach = false;

  /// Whether the emulator tells enough of the output to say what moves it.
  bool Explains() const;
};

/// Share of the runs' variance below which an emulator explains nothing; chosen.
constexpr double kLeastExplained = 0.05;

/// Options of the analysis; chosen.
struct SensitivityOptions {
  SobolOptions sobol;
  int max_runs = 120;  ///< that an emulator learns from, chosen by chance, >= 20
  int folds = 8;  ///< parts of the runs left out in turn for the emulator's share of errors, >= 2
};

/// Points over which outputs are looked at, as draws of the posterior are, made ready once.
struct RankedPoints {
  Eigen::MatrixXd standard;            ///< m x d, JointPrior::ToStandard()
  std::vector<Eigen::VectorXd> ranks;  ///< d of m: ranks by each parameter; ties share theirs
  double effective = 0;  ///< m^2 over the sum of squares of how often each different row occurs
};

/// The points (m x d, m >= 3, in the parameters' units) with their ranks. Pure.
RankedPoints Ranked(const JointPrior& priors, const Eigen::MatrixXd& points);

/// Gaussian processes in standardised parameters of one output of N runs: of all runs, and of all
/// but each of `folds` parts of them. A value; immutable after Fit. Thread safety: const.
class EmulatedOutput {
 public:
  /// Learns an output. parameters: N x d; outputs: N, finite. Deterministic. Errors:
  /// INVALID_ARGUMENT for shapes; FAILED_PRECONDITION with fewer than max(20, 3 d) runs.
  static absl::StatusOr<EmulatedOutput> Fit(const JointPrior& priors,
                                            const Eigen::MatrixXd& parameters,
                                            const Eigen::VectorXd& outputs,
                                            const SensitivityOptions& options);

  /// The output's sensitivity over the points, with indices where `sets` has some (SobolSets).
  /// Errors join the sampling's and the emulator's: the latter by a jackknife over the parts of the
  /// runs [Efron & Tibshirani 1993, ch. 11]; a part whose emulator is constant counts as one that
  /// says that nothing moves the output, 0.
  OutputSensitivity Over(const JointPrior& priors, const RankedPoints& points,
                         std::span<const Eigen::MatrixXd> sets) const;

  double explained() const { return explained_; }  ///< OutputSensitivity::explained

 private:
  explicit EmulatedOutput(GaussianProcess whole) : whole_(std::move(whole)) {}

  GaussianProcess whole_;
  std::vector<GaussianProcess> parts_;  // empty where nothing is explained
  Eigen::RowVectorXd range_;            // of the runs, standardised
  double missed_ = 0;                   // mean square leave-one-out error
  double explained_ = 0;
};

/// The sensitivity of each column of outputs (N x k) of runs at the parameters (N x d) over points
/// (m x d, m >= 3), with indices. Errors: INVALID_ARGUMENT for shapes; those of
/// EmulatedOutput::Fit.
absl::StatusOr<std::vector<OutputSensitivity>> AnalyseSensitivity(
    const JointPrior& priors, const Eigen::MatrixXd& parameters, const Eigen::MatrixXd& outputs,
    const Eigen::MatrixXd& points, const SensitivityOptions& options);

}  // namespace calib::inference
