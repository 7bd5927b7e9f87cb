#pragma once
// Laws of a chi-squared and of a mean of readings whose covariance is in part scatter between
// packings, which few packings show. Pure functions.

#include <Eigen/Core>

namespace calib::inference {

/// How well the covariance Sigma is known by which a chi-squared of n readings is taken, where a
/// part S of it is scatter that was estimated from packings.
struct KnownFrom {
  double readings = 0;  ///< n
  /// Sum over the n whitened directions of the square of the scatter's share in their variance,
  /// tr((Sigma^-1 S)^2), [0, n].
  double scatter = 0;
  int packings = 0;  ///< the scatter was estimated from; fewer than 2: Sigma is known

  /// Joins other readings, independent of these: the fewer packings of the two count.
  KnownFrom& operator+=(const KnownFrom& other);
  /// Degrees of freedom from which the size of Sigma is known, (packings - 1) n / scatter; infinite
  /// where Sigma is known.           [after Satterthwaite, Biometrics Bull. 2 (1946) 110]
  double Freedom() const;
};

/// How well a covariance is known. covariance: Sigma, n x n, positive definite; scatter: S, n x n,
/// the part of it that was estimated; packings: from how many.
KnownFrom WhatIsKnown(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& scatter,
                      int packings);

/// Chance of a chi-squared at least as large as chi2 >= 0: by Fisher's law of chi-squared over its
/// `degrees` > 0 with known.Freedom(), by the chi-squared law where the covariance is known.
double UpperTail(double chi2, double degrees, const KnownFrom& known);

/// Standard normal deviate that is exceeded as rarely as chi2 >= 0 is by the law of UpperTail with
/// `degrees` > 0, approximately [Paulson, Ann. Math. Stat. 13 (1942) 233], where the covariance is
/// known [Wilson & Hilferty, Proc. Natl. Acad. Sci. 17 (1931) 684].
double NormalDeviate(double chi2, double degrees, const KnownFrom& known);

/// Standard normal deviate that is as rare as a mean that lies `ratio` of its standard deviations
/// off, where that is in part estimated: by Student's law with (packings - 1) / share^2 degrees of
/// freedom. share: of scatter in the mean's variance, [0, 1]; packings: it was estimated from.
double NormalDeviateOfMean(double ratio, double share, int packings);

}  // namespace calib::inference
