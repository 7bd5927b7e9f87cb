#pragma once
// The few curves that span the runs' histories. Pure functions.

#include <Eigen/Core>
#include <span>

namespace calib::inference {

/// How many components FitPrincipalComponents takes. Chosen: what a hundredth of the noise variance
/// leaves out is lost in the noise.
struct PrincipalOptions {
  /// (0, 1): mean variance per reading that may be left out, in units of the noise variance.
  double truncation = 0.01;
  /// [1, 16]: scatter that is white along the path would otherwise ask for all.
  int max_components = 10;
};

/// Rows of T numbers as sums of q curves: row = mean + basis * scores + remainder.
struct PrincipalComponents {
  Eigen::RowVectorXd mean;    ///< T
  Eigen::MatrixXd basis;      ///< T x q, orthonormal columns
  Eigen::VectorXd remainder;  ///< T: mean square of what the judged rows have outside the basis

  /// Scores of the rows (m x T), m x q.
  Eigen::MatrixXd Scores(const Eigen::MatrixXd& rows) const {
    return (rows.rowwise() - mean) * basis;
  }
};

/// Principal components of weighted rows, as few as leave the judged rows a mean square per reading
/// of at most options.truncation. Weights keep rows that lie far from all that matters from turning
/// the basis towards them.
/// in: rows N x T; weights N, > 0; judged, indices of rows, at least one
PrincipalComponents FitPrincipalComponents(const Eigen::MatrixXd& rows,
                                           const Eigen::VectorXd& weights,
                                           std::span<const Eigen::Index> judged,
                                           const PrincipalOptions& options);

}  // namespace calib::inference
