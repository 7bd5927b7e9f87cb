#pragma once
// Spread of numbers, and what of it is rounding. Pure functions.

#include <Eigen/Core>

namespace calib::inference {

/// Standard error of the mean of each column's entries; two rows at least.
inline Eigen::RowVectorXd ErrorOfMean(const Eigen::MatrixXd& rows) {
  const auto n = static_cast<double>(rows.rows());
  const Eigen::RowVectorXd mean = rows.colwise().mean();
  return ((rows.rowwise() - mean).colwise().squaredNorm() / (n * (n - 1))).cwiseSqrt();
}

/// Whether a variance is no more than what rounding leaves of numbers of this size: a standard
/// deviation of 1e-13 of it, some hundred machine epsilons.
inline bool IsRounding(double variance, double size) {
  constexpr double kRelative = 1e-13;
  return !(variance > kRelative * kRelative * size * size);
}

}  // namespace calib::inference
