#pragma once
// How large the errors of a measured curve are, judged by the curve alone: what changes from one
// reading to the next and back cannot be the material's.

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::inference {

/// A stretch of readings one after the other on a smooth curve: one loading stage.
struct ReadingRun {
  Eigen::VectorXd values{};      ///< n
  Eigen::MatrixXd covariance{};  ///< n x n, of the errors as stated, in the square of the unit
};

/// Errors of the readings over the errors stated, both as they differ from one reading to the next.
struct ReadingNoise {
  int differences = 0;   ///< judged, over all runs
  double effective = 0;  ///< independent ones that would be as certain; > 0
  double scale = 0;      ///< root mean square of difference / its stated sd
  double robust = 0;     ///< the same by the median of the sizes: no corner of a curve moves it
  /// Surely larger than stated, or surely smaller (see CompareReadingNoise); at most one of them.
  bool surely_larger = false, surely_smaller = false;
};

/// Differences of order k (a sum over k + 1 neighbours with alternating binomial weights) remove a
/// polynomial of degree k - 1 and keep independent errors [von Neumann, Ann. Math. Stat. 12 (1941)
/// 367; Gasser, Sroka & Jennen-Steinmetz, Biometrika 73 (1986) 625; robust: Hampel's median of the
/// sizes over 0.6745]. Each is divided by its sd under the stated covariance: 1 is as stated. With
/// every order what is left of the curve itself falls and noise stays, so of third and fourth
/// differences the smaller scale is taken.
///   surely_larger:  0.999 lower limit of `robust` above 1.3, and fourth differences say no less
///                   than 0.6 times of what third ones say: what falls with the order is a curve,
///                   not noise.
///   surely_smaller: 0.999 upper limit of `scale` below 2/3. A curve only adds to it.
/// Limits are those of chi-squared over its degrees, the degrees m^2 / |R|_F^2 for m differences
/// with stated correlation R [Satterthwaite 1946]; of the median 0.37 of them, its efficiency.
/// Errors that are correlated over many readings but stated as independent show as smaller, too.
/// in:  runs, any number; shorter than 5 readings are passed over
/// out: no verdict from less than 6 effective differences (about 17 readings in one run)
/// Errors: INVALID_ARGUMENT when a covariance does not fit its values, is not finite or gives a
/// difference no variance.
absl::StatusOr<ReadingNoise> CompareReadingNoise(const std::vector<ReadingRun>& runs);

}  // namespace calib::inference
