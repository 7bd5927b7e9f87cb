#pragma once
// The few curves that span the runs' histories.

#include <Eigen/Core>
#include <span>

namespace calib::inference {

struct PrincipalOptions {
  /// Mean variance per reading that may be left out, in units of the readings' noise variance, (0,
  /// 1).
  double truncation = 0.01;
  int max_components =
      10;  ///< [1, 16]; scatter that is white along the path would otherwise ask for all
};

/// row = mean + basis * scores + remainder.
struct PrincipalComponents {
  Eigen::RowVectorXd mean;    ///< T
  Eigen::MatrixXd basis;      ///< T x q, orthonormal columns
  Eigen::VectorXd remainder;  ///< T: mean square of what the judged rows have outside the basis

  Eigen::MatrixXd Scores(const Eigen::MatrixXd& rows) const {
    return (rows.rowwise() - mean) * basis;
  }
};

/// Principal components of weighted rows (N x T), as few as leave the judged rows a mean square per
/// reading of at most `truncation`. Weights keep rows that lie far from all that matters from
/// turning the basis towards them.
/// in: weights > 0, N; judged: indices of rows, at least one
PrincipalComponents FitPrincipalComponents(const Eigen::MatrixXd& rows,
                                           const Eigen::VectorXd& weights,
                                           std::span<const Eigen::Index> judged,
                                           const PrincipalOptions& options);

}  // namespace calib::inference
