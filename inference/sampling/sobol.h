#pragma once
// Sobol sequence with Owen's nested uniform scrambling.

#include <Eigen/Core>
#include <cstdint>

namespace calib::inference {

/// The first n points of the d-dimensional Sobol sequence (direction numbers of Joe & Kuo 2008,
/// from Boost.Random; the origin included, so that 2^m points form a net), n x d, scrambled: bit b
/// of a coordinate is flipped by a random bit that depends on the coordinate and on all its higher
/// bits [Owen 1995]. Every point is then uniform in (0, 1)^d, and any 2^m points keep their
/// equidistribution. Pure function of (n, d, seed), and row i does not depend on n.
/// Range: 0 <= n < 2^31, 1 <= d <= 3667.
Eigen::MatrixXd ScrambledSobol(int n, int d, std::uint64_t seed);

}  // namespace calib::inference
