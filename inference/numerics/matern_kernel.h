#pragma once
// Covariance of the emulator and its marginal likelihood; inputs and outputs scaled to order one.

#include <Eigen/Core>

namespace calib::inference {

/// Prior variance b^2 of intercept and slopes, outputs having unit variance: vague, yet K stays
/// well conditioned.
inline constexpr double kTrendVariance = 10;

struct KernelParameters {
  Eigen::RowVectorXd lengths;
  double signal = 1;
};

/// k(x, x') = b^2 (1 + x . x') + s (1 + sqrt5 r + 5/3 r^2) exp(-sqrt5 r) between the rows of
/// a (m x d) and b (n x d); m x n.
Eigen::MatrixXd KernelMatrix(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                             const KernelParameters& parameters);

/// Minus the log posterior density of x = (ln l_1 ... ln l_d, ln s, ln scatter) given inputs and
/// outputs, up to a constant: marginal likelihood [Rasmussen & Williams 2006, Eqs. 5.8, 5.9] and
/// the priors
///   ln l ~ N(ln 3, 1), ln s ~ N(0, 2^2), ln scatter ~ N(ln 1e-3, 3^2):
/// smooth over the training set unless the runs say otherwise. +inf where K cannot be factorised.
class KernelObjective {
 public:
  KernelObjective(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& outputs);
  double operator()(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) const;

 private:
  const Eigen::VectorXd& outputs_;
  Eigen::MatrixXd trend_;    // n x n
  Eigen::MatrixXd squared_;  // pairs x d: squared differences, pairs (i > j) by columns j
};

}  // namespace calib::inference
