#pragma once
// Gaussian-process regression of one scalar output [Rasmussen & Williams 2006, ch. 2, 4, 5].

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Prediction of each of the n training outputs from the n - 1 others, the hyper-parameters held.
struct LeaveOneOut {
  Eigen::VectorXd error;     ///< n: output - its prediction
  Eigen::VectorXd variance;  ///< n, of `error`: what is not known of the function, and the scatter
};

/// What a process says of its function at m inputs.
struct GaussianProcessPrediction {
  Eigen::VectorXd mean;      ///< m
  Eigen::VectorXd variance;  ///< m, of the function itself; a run scatters about it besides
};

class GaussianProcess;

/// How GaussianProcess::Fit searches.
struct GaussianProcessOptions {
  /// Whether a constant takes the place of a function that explains the outputs no better. False
  /// for a search of the minimum, which must know where it has not looked yet.
  bool may_be_constant = true;
  /// Largest variance of the scatter, over the variance of the outputs; [1e-8, 2].
  double max_scatter = 2;
  /// A process of nearly the same runs, not constant(): the search begins at its hyper-parameters
  /// alone. Null: it begins at two fixed starts.
  const GaussianProcess* like = nullptr;
  /// n numbers, equal for runs that share a departure from the function, as those on one packing
  /// do; none: no run shares any. Only where !may_be_constant.
  std::vector<int> groups = {};
};

/// output = f(input) + group + scatter,  f ~ GP(0, k),  scatter ~ N(0, scatter variance)
/// independent, group ~ N(0, group variance) one for all runs of a group,
///   k(x, x') = b^2 (1 + x . x') + s (1 + sqrt5 r + 5/3 r^2) exp(-sqrt5 r),
///   r^2 = sum_j (x_j - x'_j)^2 / l_j^2,
/// a vague linear trend plus a Matern 5/2 departure with one length per input. Matern rather than
/// squared exponential: histories of granular runs bend where grains begin to slide, and the
/// squared exponential, which takes every function for analytic, then claims too small a variance
/// between the runs. Inputs are shifted and scaled to zero mean and unit standard deviation over
/// the training set, outputs likewise, so that hyper-parameters have order one. l_j, s and the
/// scatter are those of highest posterior density (KernelObjective). The function is of all inputs
/// where that is more probable than a constant; else of the inputs that one after the other raise
/// the posterior density most, the constant's first: a slope of variance b^2 along each of many
/// inputs costs (1/2) ln(1 + n b^2) nats, more than one weak input repays.
/// A value; immutable after Fit. Thread safety: const.
class GaussianProcess {
 public:
  /// Fits to n >= 4 runs. Deterministic.
  /// in: inputs n x d, outputs n, all finite
  /// Errors: FAILED_PRECONDITION when the covariance matrix can be factorised at no start.
  static absl::StatusOr<GaussianProcess> Fit(const Eigen::MatrixXd& inputs,
                                             const Eigen::VectorXd& outputs,
                                             const GaussianProcessOptions& options = {});

  /// Mean and variance of f at the rows of an m x d matrix; O(m n^2).
  GaussianProcessPrediction Predict(const Eigen::MatrixXd& inputs) const;

  /// Mean of f at the rows of an m x d matrix, m entries, the bits of Predict().mean; O(m n d).
  Eigen::VectorXd PredictMean(const Eigen::MatrixXd& inputs) const;

  /// Covariances of f at the rows of a (m x d) with f at those of b (m' x d), m x m'.
  Eigen::MatrixXd Covariance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) const;

  /// Leave-one-out predictions of the n training outputs in closed form:
  ///   error_i = alpha_i / (K^-1)_ii, variance_i = 1 / (K^-1)_ii, alpha = K^-1 outputs
  ///                                                    [Rasmussen & Williams 2006, Eqs. 5.10-5.12]
  const LeaveOneOut& leave_one_out() const { return leave_one_out_; }
  /// Variance of the scatter of a single run, in the square of the output's unit.
  double scatter_variance() const { return scatter_variance_; }
  /// Variance of what runs of a group share, likewise; 0 without groups.
  double group_variance() const { return group_variance_; }
  /// True where the process is a constant: no function of the inputs explains the outputs better.
  bool constant() const { return constant_; }
  /// d correlation lengths in units of the inputs; infinite along inputs that the function is not
  /// of.
  Eigen::VectorXd lengths() const;

 private:
  Eigen::VectorXd HyperParameters() const;  // logarithms: lengths, signal, scatter; scaled
  void SetConstant(const Eigen::VectorXd& outputs);
  Eigen::MatrixXd Scaled(const Eigen::MatrixXd& inputs) const;
  Eigen::MatrixXd Used(const Eigen::MatrixXd& inputs) const;  // scaled, of the inputs used alone
  Eigen::MatrixXd CrossCovariances(const Eigen::MatrixXd& points) const;  // scaled; n x m
  Eigen::VectorXd MeanFrom(const Eigen::MatrixXd& cross) const;
  GaussianProcessPrediction PredictBlock(const Eigen::MatrixXd& inputs) const;

  bool constant_ = false;
  Eigen::RowVectorXd input_mean_;
  Eigen::RowVectorXd input_sd_;
  double output_mean_ = 0;
  double output_sd_ = 1;
  std::vector<Eigen::Index> used_;  // the u inputs that the function is of
  Eigen::MatrixXd train_;           // n x u, scaled
  Eigen::RowVectorXd lengths_;      // u, scaled
  double signal_ = 1;               // s, in units of the output's variance
  double constant_variance_ = 0;    // of the mean, where constant
  double scatter_variance_ = 0;     // in units of the output
  double group_variance_ = 0;       // likewise
  Eigen::MatrixXd cholesky_;        // of K, lower
  Eigen::VectorXd alpha_;           // K^-1 outputs
  LeaveOneOut leave_one_out_;
};

}  // namespace calib::inference
