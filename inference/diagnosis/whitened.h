#pragma once
// Models and draws in coordinates in which distances are Mahalanobis distances.

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// Cholesky factor of a T x T covariance, shared by all that is whitened by it; never null, immutable.
using CovarianceFactor = std::shared_ptr<const Eigen::LLT<Eigen::MatrixXd>>;

/// The model in coordinates in which a measurement scatters as a standard normal: its points lie in
/// the span of q <= T axes.
struct Whitened {
  CovarianceFactor factor;  ///< of the covariance
  Eigen::MatrixXd axes;     ///< T x q, orthonormal
  Eigen::MatrixXd points;   ///< q x G, along the axes
  Eigen::VectorXd squares;  ///< G, of the points' lengths

  Eigen::VectorXd Point(Eigen::Index g) const { return axes * points.col(g); }  ///< T
};

/// Draws and the coordinates they are judged in.
struct DrawnGroup {
  Whitened model;
  std::vector<Eigen::Index> number;  ///< of the draws, ascending
  Eigen::MatrixXd draws;             ///< T x number of them, whitened
};

Whitened WhitenBy(CovarianceFactor factor, const Histories& histories);

/// Errors: INVALID_ARGUMENT for shapes that do not fit, a covariance that is not positive definite.
absl::StatusOr<Whitened> Whiten(const FittedModel& model);

/// All draws of the model, in the order of their groups; none where the model has none. Errors as
/// above, and for fewer than 50 draws.
absl::StatusOr<std::vector<DrawnGroup>> DrawsOf(const FittedModel& model);

/// Inner products of every point and each column of directions (T x S, whitened): G x S.
Eigen::MatrixXd Along(const Whitened& whitened, const Eigen::MatrixXd& directions);

/// |point + offset|^2 of every point, G; offset: T, whitened.
Eigen::VectorXd DistancesFrom(const Whitened& whitened, const Eigen::VectorXd& offset);

/// Of each column of offsets the point with the smallest |point + offset|^2.
struct Nearest {
  Eigen::VectorXd squares;           ///< S
  std::vector<Eigen::Index> points;  ///< S
};

/// offsets: T x S, whitened.
Nearest NearestTo(const Whitened& whitened, const Eigen::MatrixXd& offsets);

}  // namespace calib::inference
