#pragma once
// Models and draws in coordinates in which distances are Mahalanobis distances: whitened by the
// Cholesky factor of a T x T covariance. Plain values and pure functions.

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// Cholesky factor of a T x T covariance, shared by all that is whitened by it; never null,
/// immutable.
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

/// Draws of a measurement and the coordinates they are judged in.
struct DrawnGroup {
  Whitened model;                    ///< the model in these coordinates
  std::vector<Eigen::Index> number;  ///< rows of FittedModel::draws, ascending
  Eigen::MatrixXd draws;             ///< T x number.size(), whitened
};

/// The histories whitened by a factor of a T x T covariance.
Whitened WhitenBy(CovarianceFactor factor, const Histories& histories);

/// The model whitened by its covariance. Errors: INVALID_ARGUMENT for histories and covariance that
/// do not fit together or are not finite, or a covariance that is not positive definite.
absl::StatusOr<Whitened> Whiten(const FittedModel& model);

/// All draws of the model, in the order of their groups, each group by its own covariance
/// (FittedModel::without); none where the model has none. Errors: INVALID_ARGUMENT for fewer than
/// 50 draws, draws or groups that do not fit, or a covariance that is not positive definite.
absl::StatusOr<std::vector<DrawnGroup>> DrawsOf(const FittedModel& model);

/// Inner products of each of the G points and each column of directions (T x S, whitened), G x S.
Eigen::MatrixXd Along(const Whitened& whitened, const Eigen::MatrixXd& directions);

/// |point + offset|^2 of each of the G points; offset: T, whitened.
Eigen::VectorXd DistancesFrom(const Whitened& whitened, const Eigen::VectorXd& offset);

/// For each of S offsets the point with the smallest |point + offset|^2.
struct Nearest {
  Eigen::VectorXd squares;           ///< S: that square
  std::vector<Eigen::Index> points;  ///< S: index of the point
};

/// The nearest point for each column of offsets (T x S, whitened).
Nearest NearestTo(const Whitened& whitened, const Eigen::MatrixXd& offsets);

}  // namespace calib::inference
