#pragma once
// Latin hypercube designs [McKay, Beckman & Conover 1979] and their symmetric kind [Ye, Li &
// Sudjianto 2000].

#include <Eigen/Core>
#include <cstdint>

#include "absl/status/statusor.h"

namespace calib::inference {

struct LatinHypercubeOptions {
  int points = 0;      ///< n >= 2
  int dimensions = 0;  ///< d >= 1
  /// Every point has its mirror image about the centre in the design.
  bool symmetric = false;
  /// Points in the middle of their cells; false: uniform within them. A symmetric design is always
  /// centred.
  bool centred = true;
  /// Designs drawn, of which the one with the largest smallest distance between two points is kept,
  /// >= 1 [Samuelsson 2023, sec. 3.2: 1000].
  int candidates = 1;
  std::uint64_t seed = 0;
  absl::Status Validate() const;
};

/// n x d points in (0, 1); each column has exactly one point in each of n equal cells. Pure
/// function of the options; candidate c of a seed is the same whatever the number of candidates,
/// ties keep the earlier. Errors: INVALID_ARGUMENT from Validate.
absl::StatusOr<Eigen::MatrixXd> LatinHypercube(const LatinHypercubeOptions& options);

/// Smallest Euclidean distance between two rows; at least two rows.
double SmallestDistance(const Eigen::MatrixXd& points);

/// True when the rows and a constant span d + 1 dimensions, as a linear tail needs; 2 d + 1 points
/// of a symmetric design do with probability near one [Samuelsson 2023, sec. 3.2].
bool SpansLinearFunctions(const Eigen::MatrixXd& points);

}  // namespace calib::inference
