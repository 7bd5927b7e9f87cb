#pragma once
// What twins say of the error that runs on one packing are emulated with: how much of it is chance
// of a specimen, how much the emulator's own.

#include <Eigen/Core>

namespace calib::inference {

/// Variances in q coordinates.
struct TwinScatter {
  Eigen::VectorXd specimen{};  ///< q: what two specimens alike differ by, half the square of it
  Eigen::VectorXd missed{};  ///< q: what the emulator misses of runs beside, alike in all specimens
  double freedom = 0;        ///< degrees of freedom of `specimen`
};

/// ln of (variance of the twins / variance of the emulator's residuals) is seen in each coordinate
/// with the errors of two log variances; its true values are taken for normal about a common mean,
/// both moments estimated, and each is shrunk towards that mean as far as coordinates differ by no
/// more than chance [Efron & Morris, JASA 70 (1975) 311; log variances: Bartlett & Kendall, Suppl.
/// J. R. Stat. Soc. 8 (1946) 128]. Few twins thus say how large the scatter is, and only clear
/// differences change its shape. Twins that scatter less than the residuals leave the sum as it is;
/// where they scatter more, the runs near the best estimate do, and the sum grows. The degrees of
/// freedom follow from the number of twins as far as `specimen` does, from the residuals'
/// otherwise. Pure. in: twins R x q, R >= 2: departures of twins from their mean; residual q, > 0:
/// variance of what
///     runs depart by from the emulator; freedom > 0: its degrees of freedom, which the result does
///     not exceed
TwinScatter SplitByTwins(const Eigen::MatrixXd& twins, const Eigen::VectorXd& residual,
                         double freedom);

}  // namespace calib::inference
