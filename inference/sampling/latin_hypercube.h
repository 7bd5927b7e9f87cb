#pragma once
// Latin hypercube designs [McKay, Beckman & Conover 1979] and their symmetric kind
// [Ye, Li & Sudjianto 2000].

#include <Eigen/Core>
#include <cstdint>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Which design LatinHypercube makes.
struct LatinHypercubeOptions {
  int points = 0;          ///< n >= 2
  int dimensions = 0;      ///< d >= 1
  bool symmetric = false;  ///< every point has its mirror image about the centre in the design
  /// Points lie in the middle of their cells; false: uniformly within them. A symmetric design is
  /// always centred.
  bool centred = true;
  /// Designs drawn, >= 1, of which the one whose two closest points lie farthest apart is kept
  /// [Samuelsson 2023, sec. 3.2: 1000].
  int candidates = 1;
  std::uint64_t seed = 0;
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// A Latin hypercube of n x d points in (0, 1): each column has exactly one point in each of n
/// equal cells. Pure function of the options: candidate c of a seed is the same whatever the number
/// of candidates, and of two that are as good the earlier is kept. Errors: INVALID_ARGUMENT from
/// Validate.
absl::StatusOr<Eigen::MatrixXd> LatinHypercube(const LatinHypercubeOptions& options);

/// Smallest Euclidean distance between two rows of an n x d matrix; +infinity for fewer than two
/// rows. Pure.
double SmallestDistance(const Eigen::MatrixXd& points);

/// True when n x d points determine a linear function c_0 + c . x: the matrix of their rows with a
/// one in front has rank d + 1. 2 d + 1 points of a symmetric design do with probability near one
/// [Samuelsson 2023, sec. 3.2]. Pure.
bool SpansLinearFunctions(const Eigen::MatrixXd& points);

}  // namespace calib::inference
