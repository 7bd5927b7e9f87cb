#include "inference/scatter/refit_spread.h"

#include <cassert>
#include <cmath>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {

using Eigen::Index;

Eigen::MatrixXd ScaledDepartures(const Eigen::MatrixXd& runs, const Eigen::VectorXd& share) {
  Eigen::MatrixXd finished(runs.rows(), runs.cols());
  Index count = 0;
  for (Index r = 0; r < runs.rows(); ++r) {
    if (runs.row(r).allFinite()) finished.row(count++) = runs.row(r);
  }
  if (count < 2) return Eigen::MatrixXd(0, runs.cols());
  finished.conservativeResize(count, Eigen::NoChange);
  Eigen::MatrixXd departures = finished.rowwise() - finished.colwise().mean();
  for (Index k = 0; k < departures.cols(); ++k) {
    departures.col(k) *= share[k] < 0 ? 0 : std::sqrt(share[k] + 1 / static_cast<double>(count));
  }
  return departures;
}

Eigen::MatrixXd SpreadOfRefits(const Eigen::MatrixXd& draws, const Eigen::MatrixXd& histories,
                               const Eigen::MatrixXd& covariance, const Replicates& replicates) {
  const Index count = replicates.departures.rows();
  assert(count >= 2 && draws.rows() == histories.rows());
  const Eigen::MatrixXd z = draws.rowwise() - draws.colwise().mean();
  const Eigen::MatrixXd h = histories.rowwise() - histories.colwise().mean();
  const auto n = static_cast<double>(draws.rows() - 1);
  const Eigen::MatrixXd posterior = z.transpose() * z / n;
  // The estimate moves by gain * difference of a measurement: C J^T K^-1, C J^T from the draws.
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::MatrixXd gain = Solved(factor, h.transpose() * z / n).transpose();  // d x T
  const Eigen::MatrixXd shifts = gain * replicates.departures.transpose();         // d x R
  const auto freedom = static_cast<double>(count - 1);
  const double ratio = StudentRatio(freedom);
  const Eigen::MatrixXd beyond = ratio * ratio / freedom * (shifts * shifts.transpose()) -
                                 gain * replicates.scatter * gain.transpose();
  // Its positive part, in coordinates in which the posterior is a unit sphere.
  const Eigen::LLT<Eigen::MatrixXd> sphere(posterior);
  if (factor.info() != Eigen::Success || sphere.info() != Eigen::Success) {
    return Eigen::MatrixXd::Zero(draws.cols(), draws.cols());
  }
  const Eigen::MatrixXd half = LowerSolved(sphere, beyond);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(LowerSolved(sphere, half.transpose()));
  const Eigen::MatrixXd axes = sphere.matrixL() * parts.eigenvectors();
  return axes * parts.eigenvalues().cwiseMax(0).asDiagonal() * axes.transpose();
}

}  // namespace calib::inference
