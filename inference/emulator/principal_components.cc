#include "inference/emulator/principal_components.h"

#include <algorithm>
#include <cmath>

#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

// Eigenvalue over the largest, the square of a singular value's, below which a component is
// rounding.
constexpr double kRounding = 1e-14;

}  // namespace

using Eigen::Index;

PrincipalComponents FitPrincipalComponents(const Eigen::MatrixXd& rows,
                                           const Eigen::VectorXd& weights,
                                           std::span<const Index> judged,
                                           const PrincipalOptions& options) {
  const Index n = rows.rows();
  const Index t = rows.cols();
  PrincipalComponents result;
  result.mean = weights.transpose() * rows / weights.sum();
  const Eigen::MatrixXd centred = rows.rowwise() - result.mean;
  const Eigen::MatrixXd weighted = weights.asDiagonal() * centred;

  // Right singular vectors from the smaller of the two Gram matrices. Squaring the condition number
  // costs only components below 1e-8 of the first, far below any noise.
  const bool by_rows = n < t;
  const Eigen::MatrixXd gram = by_rows ? Eigen::MatrixXd(weighted * weighted.transpose())
                                       : Eigen::MatrixXd(weighted.transpose() * weighted);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);  // ascending
  const Index rank = std::min<Index>({n, t, options.max_components});

  Eigen::MatrixXd left(static_cast<Index>(judged.size()), t);
  for (Index i = 0; i < left.rows(); ++i)
    left.row(i) = centred.row(judged[static_cast<std::size_t>(i)]);
  result.basis.resize(t, rank);
  Index q = 0;
  while (q < rank) {
    const Index k = gram.rows() - 1 - q;
    if (!(eigen.eigenvalues()[k] > kRounding * eigen.eigenvalues()[gram.rows() - 1])) break;
    const Eigen::VectorXd vector = eigen.eigenvectors().col(k);
    result.basis.col(q) =
        by_rows ? Eigen::VectorXd((weighted.transpose() * vector).normalized()) : vector;
    left -= (left * result.basis.col(q)) * result.basis.col(q).transpose();
    ++q;
    if (left.squaredNorm() <= options.truncation * static_cast<double>(left.size())) break;
  }
  result.basis.conservativeResize(t, q);
  result.remainder = left.colwise().squaredNorm().transpose() / static_cast<double>(left.rows());
  return result;
}

}  // namespace calib::inference
