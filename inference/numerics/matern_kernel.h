#pragma once
// Covariance of a Gaussian process and the posterior density of its hyper-parameters. Inputs and
// outputs are taken as scaled to zero mean and unit standard deviation.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// Prior variance b^2 of the process's intercept and of each slope, in units of the outputs'
/// variance. Chosen: three standard deviations of the outputs per standard deviation of an input
/// are vague for scaled data, and the covariance matrix stays well conditioned.
inline constexpr double kTrendVariance = 10;

/// Hyper-parameters of the kernel that KernelMatrix evaluates.
struct KernelParameters {
  Eigen::RowVectorXd lengths;  ///< d, > 0: correlation length along each input
  double signal = 1;           ///< s > 0: variance of the departure from the linear trend
};

/// The kernel between the rows x of a (m x d) and x' of b (n x d), m x n:
///   k(x, x') = b^2 (1 + x . x') + s (1 + sqrt5 r + 5/3 r^2) exp(-sqrt5 r),
///   r^2 = sum_j (x_j - x'_j)^2 / l_j^2,
/// a linear trend plus a Matern 5/2 function.        [Rasmussen & Williams 2006, sec. 2.7, 4.2.1]
Eigen::MatrixXd KernelMatrix(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                             const KernelParameters& parameters);

/// Minus the log posterior density of the hyper-parameters x = (ln l_1 ... ln l_d, ln s, ln v), v
/// the variance of independent scatter, given inputs and outputs, up to a constant: the marginal
/// likelihood [Rasmussen & Williams 2006, Eqs. 5.8, 5.9] and the priors
///   ln l_j ~ N(ln 3, 1), ln s ~ N(0, 2^2), ln v ~ N(ln 1e-3, 3^2),
/// chosen weak: smooth over the training set unless the outputs say otherwise. A SmoothFunction of
/// d + 2 variables; +infinity where the covariance matrix cannot be factorised. With groups, runs
/// of one group share a departure of variance g: a last variable ln g ~ N(ln 1e-3, 3^2). Keeps a
/// reference to the outputs. Thread safety: const after construction.
class KernelObjective {
 public:
  /// The objective given n runs. inputs: n x d; outputs: n, which outlives this object; groups: n
  /// numbers of any value, or none
  KernelObjective(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& outputs,
                  const std::vector<int>& groups = {});
  /// The value at x; writes its derivatives to `gradient`, which has the size of x.
  double operator()(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) const;

 private:
  const Eigen::VectorXd& outputs_;
  Eigen::MatrixXd trend_;    // n x n
  Eigen::MatrixXd squared_;  // pairs x d: squared differences, pairs (i > j) by columns j
  Eigen::ArrayXd together_;  // pairs: 1 where both runs are of one group; empty without groups
};

}  // namespace calib::inference
