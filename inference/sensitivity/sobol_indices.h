#pragma once
// Which parameters move an output, over the whole range of their prior: variance-based indices.

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// Of one output y(x_1 ... x_d), independent x_j:
///   first_j = Var(E[y | x_j]) / Var(y),   total_j = 1 - Var(E[y | x_-j]) / Var(y)
///                                                        [Sobol 1993; Homma & Saltelli 1996]
/// An index may come out slightly below 0 or above 1: its error is stated, it is not clipped.
struct SobolIndices {
  Eigen::VectorXd first, total;              ///< d; NaN where the output does not vary
  Eigen::VectorXd first_error, total_error;  ///< d, standard errors
  double mean = 0;
  double variance = 0;
};

struct SobolOptions {
  int points = 1024;    ///< N of a set, a power of two for the balance of Sobol points, >= 2
  int replicates = 16;  ///< independently scrambled sets, whose spread is the error, >= 2
  std::uint64_t seed = 0;
};

/// Outputs (m x k) at m points of the unit cube (m x d).
using UnitFunction = std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>;

/// First order by Saltelli et al. 2010, Table 2 (b), total by Jansen 1999, each from N (d + 2)
/// evaluations per set. One entry per output. Pure function of its arguments if f is one.
std::vector<SobolIndices> EstimateSobolIndices(int dimensions, const SobolOptions& options,
                                               const UnitFunction& f);

/// An output of a model that was run N times, emulated.
struct OutputSensitivity {
  /// Over the prior; empty where the prior's parameters are not independent or nothing is explained.
  SobolIndices indices;
  /// 1 - mean square leave-one-out error / variance of the runs; NaN where all runs are equal.
  double explained = 0;
  double mean = 0;  ///< of the emulated output over the points
  double sd = 0;    ///< likewise, and the emulator's leave-one-out error in quadrature
  /// d, of the output's rank with each parameter's, over the points; empty where nothing is
  /// explained, NaN for a parameter that does not vary over them.
  Eigen::VectorXd correlation;
  Eigen::VectorXd correlation_error;  ///< d

  /// Whether the emulator tells enough of the output to say what moves it.
  bool Explains() const;
};

/// Share of the runs' variance below which an emulator explains nothing.
constexpr double kLeastExplained = 0.05;

struct SensitivityOptions {
  SobolOptions sobol;
  bool indices = true;  ///< false: correlations alone
  int max_runs = 120;   ///< that the emulator learns from, evenly chosen, >= 20
  int folds = 8;  ///< parts of the runs left out in turn for the emulator's share of errors, >= 2
};

/// Of each column of outputs (N x k, finite) from N runs at parameters (N x d): a Gaussian process
/// in standardised parameters, its Sobol indices over the prior, and the rank correlations with the
/// parameters over points (m x d, e.g. draws of the posterior). Errors join the sampling's and the
/// emulator's: the latter by a jackknife over `folds` parts of the runs [Efron & Tibshirani 1993,
/// ch. 11]; a part whose emulator is constant says that nothing moves the output, 0. Errors: INVALID_ARGUMENT for shapes; FAILED_PRECONDITION with fewer than max(20, 3 d)
/// runs.
absl::StatusOr<std::vector<OutputSensitivity>> AnalyseSensitivity(
    const JointPrior& priors, const Eigen::MatrixXd& parameters, const Eigen::MatrixXd& outputs,
    const Eigen::MatrixXd& points, const SensitivityOptions& options);

}  // namespace calib::inference
