#pragma once
// Histories as few smooth functions of the path in each stage of loading. Pure functions.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// The readings of one observable of one experiment.
struct PathCurve {
  std::vector<int>
      stage{};             ///< n >= 1 numbers, equal for readings of a stage, which stand together
  Eigen::VectorXd path{};  ///< n, ascending: distance travelled along the loading path
};

/// M x T: the coefficients of all curves, one after the other, as linear functions of their T
/// readings, by least squares. A stage of n readings has min(4, (n + 1) / 2) Legendre polynomials
/// of sqrt(path since its first reading), scaled to [-1, 1]: curves bend most where the load turns.
///                                                                   [Abramowitz & Stegun 22.7.10]
struct StageProjection {
  Eigen::MatrixXd matrix{};   ///< M x T
  std::vector<int> degree{};  ///< M: of the polynomial
};

/// The projection of these curves, whose readings stand one after the other.
StageProjection ProjectStages(const std::vector<PathCurve>& curves);

}  // namespace calib::inference
