#pragma once
// Models and draws in coordinates in which distances are Mahalanobis distances.

#include <Eigen/Dense>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// The model in coordinates in which a measurement scatters as a standard normal.
struct Whitened {
  Eigen::LLT<Eigen::MatrixXd> factor;  ///< of the covariance
  Eigen::MatrixXd points;              ///< T x G
  Eigen::VectorXd squares;             ///< G, of the points' lengths
};

/// Draws and the coordinates they are judged in.
struct DrawnGroup {
  Whitened model;
  std::vector<Eigen::Index> number;  ///< of the draws, ascending
  Eigen::MatrixXd draws;             ///< T x number of them, whitened
};

/// Errors: INVALID_ARGUMENT for shapes that do not fit, a covariance that is not positive definite.
absl::StatusOr<Whitened> Whiten(const FittedModel& model);

/// All draws of the model, in the order of their groups; none where the model has none. Errors as
/// above, and for fewer than 50 draws.
absl::StatusOr<std::vector<DrawnGroup>> DrawsOf(const FittedModel& model);

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
