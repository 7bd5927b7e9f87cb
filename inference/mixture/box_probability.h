#pragma once
// Mass of a multivariate Gaussian inside a box.

#include <Eigen/Dense>

namespace calib::inference {

/// P(low < L z < high), z standard normal in d dimensions, by Genz's separation of variables [Genz
/// 1992, "Numerical computation of multivariate normal probabilities"]: coordinate by coordinate
/// the interval left by the earlier ones is sampled by inversion and its mass multiplied, over 4096
/// points of the Halton sequence. Deterministic; exact for diagonal L, else about 2e-3 relative for
/// d <= 6 (verified in the tests). in: cholesky lower triangular with positive diagonal; low, high
/// relative to the mean, +-infinity allowed, low <= high out: in [0, 1]
double BoxProbability(const Eigen::MatrixXd& cholesky, const Eigen::VectorXd& low,
                      const Eigen::VectorXd& high);

}  // namespace calib::inference
