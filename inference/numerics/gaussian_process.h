#pragma once
// Gaussian-process regression of one scalar output [Rasmussen & Williams 2006, ch. 2, 4, 5].

#include <Eigen/Core>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Leave-one-out prediction of each training output, the hyper-parameters held.
struct LeaveOneOut {
  Eigen::VectorXd error;     ///< output - its prediction from the others, n
  Eigen::VectorXd variance;  ///< of that error: of the function and of the scatter of one run, n
};

struct GaussianProcessPrediction {
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;  ///< of the function itself, without the scatter of a run
};

class GaussianProcess;

struct GaussianProcessOptions {
  /// Whether a constant takes the place of a function that explains the outputs no better. A search
  /// says no: it must know where it has not looked yet.
  bool may_be_constant = true;
  double max_scatter = 2;  ///< variance of the scatter over that of the outputs, [1e-8, 2]
  /// Not constant, of nearly the same runs: its hyper-parameters are where the search begins, in
  /// place of both starts.
  const GaussianProcess* like = nullptr;
};

/// output = f(input) + scatter,  f ~ GP(0, k),  scatter ~ N(0, scatter variance) independent,
///   k(x, x') = b^2 (1 + x . x') + s (1 + sqrt5 r + 5/3 r^2) exp(-sqrt5 r),
///   r^2 = sum_j (x_j - x'_j)^2 / l_j^2,
/// a vague linear trend plus a Matern 5/2 departure with one length per input. Matern rather than
/// squared exponential: histories of granular runs bend where grains begin to slide, and the
/// squared exponential, which takes every function for analytic, then claims too small a variance
/// between the runs. Inputs are shifted and scaled to zero mean and unit standard deviation over
/// the training set, outputs likewise, so that hyper-parameters have order one. l_j, s and the
/// scatter are those of highest posterior density: marginal likelihood times weak log-normal
/// priors, from two fixed starts (smooth, wiggly) or from options.like. Thread safety: const after
/// Fit.
class GaussianProcess {
 public:
  /// in: inputs n x d, outputs n, n >= 4, all finite.
  /// Errors: FAILED_PRECONDITION when no start can be factorised.
  static absl::StatusOr<GaussianProcess> Fit(const Eigen::MatrixXd& inputs,
                                             const Eigen::VectorXd& outputs,
                                             const GaussianProcessOptions& options = {});

  /// Mean and variance of f at the rows of an m x d matrix; O(m n^2).
  GaussianProcessPrediction Predict(const Eigen::MatrixXd& inputs) const;

  /// The mean alone, the same bits; O(m n d).
  Eigen::VectorXd PredictMean(const Eigen::MatrixXd& inputs) const;

  /// Closed form [Rasmussen & Williams 2006, Eqs. 5.10-5.12]: error_i = alpha_i / (K^-1)_ii,
  /// variance_i = 1 / (K^-1)_ii.
  const LeaveOneOut& leave_one_out() const { return leave_one_out_; }
  double scatter_variance() const { return scatter_variance_; }
  bool constant() const { return constant_; }
  /// l_j in units of the inputs.
  Eigen::VectorXd lengths() const { return lengths_.cwiseProduct(input_sd_); }

 private:
  Eigen::VectorXd HyperParameters() const;  // logarithms: lengths, signal, scatter; scaled
  void SetConstant(const Eigen::VectorXd& outputs);
  Eigen::MatrixXd Scaled(const Eigen::MatrixXd& inputs) const;
  Eigen::MatrixXd CrossCovariances(const Eigen::MatrixXd& points) const;  // scaled; n x m
  Eigen::VectorXd MeanFrom(const Eigen::MatrixXd& cross) const;
  GaussianProcessPrediction PredictBlock(const Eigen::MatrixXd& inputs) const;

  bool constant_ = false;
  Eigen::RowVectorXd input_mean_;
  Eigen::RowVectorXd input_sd_;
  double output_mean_ = 0;
  double output_sd_ = 1;
  Eigen::MatrixXd train_;         // n x d, scaled
  Eigen::RowVectorXd lengths_;    // scaled
  double signal_ = 1;             // s, in units of the output's variance
  double constant_variance_ = 0;  // of the mean, where constant
  double scatter_variance_ = 0;   // in units of the output
  Eigen::MatrixXd cholesky_;      // of K, lower
  Eigen::VectorXd alpha_;         // K^-1 outputs
  LeaveOneOut leave_one_out_;
};

}  // namespace calib::inference
