#pragma once
// Cubic radial basis function interpolant with a linear tail
// [Powell 1992; Regis & Shoemaker 2007].

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/status.h"

namespace calib::inference {

/// The interpolant s(x) = sum_i lambda_i |x - x_i|^3 + c_0 + c . x in d dimensions through all n
/// points (x_i, f_i), with sum_i lambda_i = 0 and sum_i lambda_i x_i = 0, no regularisation.
///
/// d + 1 points in general position and the tail form a small block A, factorised once; what the
/// other points leave,
///   S = Phi_22 - B^T A^-1 B,
/// is positive definite because the cubic kernel is so on the functions that vanish on linear
/// polynomials. A further point therefore adds one row to a Cholesky factor: O(n^2) instead of
/// O(n^3). Points that arrive before d + 1 of them are in general position wait. A value; thread
/// safety: const.
class CubicRbf {
 public:
  /// An interpolant without points. dimensions: d >= 1
  explicit CubicRbf(int dimensions) : dimensions_(dimensions) {}

  /// Adds a point (d) with its value. Errors: INVALID_ARGUMENT when it (nearly) coincides with an
  /// earlier one, or anything is not finite; the interpolant is unchanged then.
  absl::Status Add(const Eigen::VectorXd& point, double value);

  int dimensions() const { return dimensions_; }                 ///< d
  int size() const { return static_cast<int>(points_.size()); }  ///< n
  /// True once d + 1 points are in general position; evaluate only then.
  bool ready() const { return tail_points_.size() == static_cast<std::size_t>(dimensions_) + 1; }

  /// The interpolant s at x (d). Precondition: ready().
  double Value(const Eigen::VectorXd& x) const;
  /// The d derivatives of s at x. Precondition: ready().
  Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const;
  /// The interpolant s at x from distances |x - x_i| already at hand (n, in the order of Add).
  /// Precondition: ready().
  double Value(const Eigen::VectorXd& x, const Eigen::VectorXd& distances) const;

  /// Point x_i, counted in the order of Add.
  const Eigen::VectorXd& point(int i) const { return points_[static_cast<std::size_t>(i)]; }
  /// Value f_i, counted in the order of Add.
  double value(int i) const { return values_[static_cast<std::size_t>(i)]; }
  /// Coefficients lambda of the points in the order of Add, n entries.
  const Eigen::VectorXd& coefficients() const { return coefficients_; }
  /// Coefficients c_0, c_1 ... c_d of the linear tail, d + 1 entries.
  const Eigen::VectorXd& tail() const { return tail_; }

 private:
  Eigen::VectorXd Border(
      int i) const;  // (1, x_i, |x_i - t_0|^3 ... |x_i - t_d|^3), t the tail points
  bool ChooseTailPoints();
  bool AppendRow(int i);
  void Solve();

  int dimensions_;
  std::vector<Eigen::VectorXd> points_;
  std::vector<double> values_;
  std::vector<int> tail_points_;  // d + 1 indices, ascending
  std::vector<int> others_;       // the rest in the order of the factor's rows
  std::shared_ptr<const Eigen::PartialPivLU<Eigen::MatrixXd>> block_;  // A = [0 P^T; P Phi_11]
  std::vector<Eigen::VectorXd> borders_;                               // columns of B
  std::vector<Eigen::VectorXd> solved_;                                // columns of A^-1 B
  std::vector<Eigen::VectorXd> factor_;  // rows of the Cholesky factor of S
  Eigen::VectorXd coefficients_;
  Eigen::VectorXd tail_;
};

}  // namespace calib::inference
