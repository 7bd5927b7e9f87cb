#pragma once
// Eigen's decompositions of dense real matrices of any size, instantiated in one source file. A
// file that includes this one instead of Eigen's headers compiles in about half the time and
// computes the same bits. For source files: no header of this library includes it, so that its
// users do not.
//
// Pure functions of their arguments; thread safety: const.

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace Eigen {

extern template LLT<MatrixXd>& LLT<MatrixXd>::compute<MatrixXd>(const EigenBase<MatrixXd>&);
extern template SelfAdjointEigenSolver<MatrixXd>&
SelfAdjointEigenSolver<MatrixXd>::compute<MatrixXd>(const EigenBase<MatrixXd>&, int);
extern template class HouseholderQR<MatrixXd>;
extern template class ColPivHouseholderQR<MatrixXd>;

}  // namespace Eigen

namespace calib::inference {

/// X with A X = B, for the factorised A = L L^T, n x n.
/// in: right, B, n x m
/// out: X, n x m
Eigen::MatrixXd Solved(const Eigen::LLT<Eigen::MatrixXd>& factor, const Eigen::MatrixXd& right);

/// X with L X = B, for the factorised A = L L^T, n x n.
/// in: right, B, n x m
/// out: X, n x m
Eigen::MatrixXd LowerSolved(const Eigen::LLT<Eigen::MatrixXd>& factor,
                            const Eigen::MatrixXd& right);

/// The X of least |A X - B| for the decomposed A, n x d; of several, the one of its pivoted columns
/// alone.
/// in: right, B, n x m
/// out: X, d x m
Eigen::MatrixXd Solved(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& factor,
                       const Eigen::MatrixXd& right);

/// Orthonormal columns that span those of the decomposed n x d matrix, d <= n: Q of A = Q R, n x d.
Eigen::MatrixXd OrthonormalColumns(const Eigen::HouseholderQR<Eigen::MatrixXd>& factor);

}  // namespace calib::inference
