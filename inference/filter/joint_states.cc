#include "inference/filter/joint_states.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kMostStates = 3;  // as many as the paper's states: p, q and porosity [Cheng 2019]
constexpr double kLeastVariance = 0.01;  // chosen: share of the states' variance of a coordinate

Eigen::MatrixXd Centred(const Eigen::MatrixXd& rows, const Eigen::VectorXd& shares) {
  return rows.rowwise() - shares.transpose() * rows;
}

}  // namespace

WeightedPoints JoinStates(const WeightedPoints& parameters, const Eigen::MatrixXd& states) {
  const Index d = parameters.points.rows();
  const Index n = parameters.points.cols();
  assert(states.rows() == n && states.cols() > 0);
  if (n <= d + 2) return parameters;
  const Eigen::VectorXd shares = parameters.counts / parameters.counts.sum();
  const Eigen::VectorXd roots = shares.cwiseSqrt();
  const Eigen::MatrixXd regressors =
      roots.asDiagonal() * Centred(parameters.points.transpose(), shares);
  const Eigen::MatrixXd weighted = roots.asDiagonal() * Centred(states, shares);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> regression(regressors);
  const Eigen::MatrixXd residuals = weighted - regressors * Solved(regression, weighted);

  // Left singular vectors, times their singular values, from the smaller of the two Gram matrices.
  const bool by_points = n < states.cols();
  const Eigen::MatrixXd gram = by_points ? Eigen::MatrixXd(residuals * residuals.transpose())
                                         : Eigen::MatrixXd(residuals.transpose() * residuals);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);  // ascending
  const double least = kLeastVariance * weighted.squaredNorm();
  const double scale = std::sqrt(regressors.squaredNorm() / static_cast<double>(d));
  WeightedPoints joint = parameters;
  for (Index k = 0; k < std::min(kMostStates, gram.rows()); ++k) {
    const Index column = gram.rows() - 1 - k;
    const double variance = eigen.eigenvalues()[column];
    if (!(variance > least)) break;
    const Eigen::VectorXd vector = eigen.eigenvectors().col(column);
    const Eigen::VectorXd scores =
        by_points ? Eigen::VectorXd(vector * scale)
                  : Eigen::VectorXd(residuals * vector * (scale / std::sqrt(variance)));
    joint.points.conservativeResize(d + k + 1, Eigen::NoChange);
    joint.points.row(d + k) = scores.cwiseQuotient(roots).transpose();
  }
  return joint;
}

}  // namespace calib::inference
