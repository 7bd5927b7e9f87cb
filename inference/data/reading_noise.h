#pragma once
// How large the errors of a measured curve are, judged by the curve alone: what changes from one
// reading to the next and back cannot be the material's.

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Readings one after the other on a smooth curve: those of one observable in one loading stage.
struct ReadingRun {
  Eigen::VectorXd values{};      ///< n
  Eigen::MatrixXd covariance{};  ///< n x n, of the errors as stated, in the square of the unit
};

/// Size of the readings' errors over their stated size, judged by differences between neighbours.
struct ReadingNoise {
  int differences = 0;   ///< judged, over all runs
  double effective = 0;  ///< independent differences that would be as certain, >= 0
  double scale = 0;      ///< root mean square of each difference over its stated sd; 1: as stated
  double robust = 0;     ///< `scale` by the median of the sizes, which no corner of a curve moves
  bool surely_larger = false;   ///< than stated, as CompareReadingNoise decides
  bool surely_smaller = false;  ///< than stated, as CompareReadingNoise decides
};

/// How large the errors of readings are over what is stated, by their differences of order k (a sum
/// over k + 1 neighbours with alternating binomial weights), which remove a polynomial of degree
/// k - 1 and keep independent errors [von Neumann, Ann. Math. Stat. 12 (1941) 367]
/// [Gasser, Sroka & Jennen-Steinmetz, Biometrika 73 (1986) 625]. Each is divided by its sd under
/// the stated covariance. With every order what is left of the curve itself falls and noise stays,
/// so of third and fourth differences the smaller scale is taken.
///   surely_larger:  0.999 lower limit of `robust` above 1.3, and fourth differences say no less
///                   than 0.6 times of what third ones say: what falls with the order is a curve,
///                   not noise.
///   surely_smaller: 0.999 upper limit of `scale` below 2/3. A curve only adds to it.
/// Limits are those of chi-squared over its degrees, the degrees m^2 / |R|_F^2 for m differences
/// with stated correlation R [Satterthwaite, Biometrics Bull. 2 (1946) 110]; of the median 0.37 of
/// them, its efficiency. Errors that are correlated over many readings but stated as independent
/// show as smaller, too. Pure.
/// in: runs, any number; shorter than 5 readings are passed over
/// out: no verdict from less than 6 effective differences (about 17 readings in one run)
/// Errors: INVALID_ARGUMENT when a covariance does not fit its values, is not finite or gives a
/// difference no variance.
absl::StatusOr<ReadingNoise> CompareReadingNoise(const std::vector<ReadingRun>& runs);

}  // namespace calib::inference
