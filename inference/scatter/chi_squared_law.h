#pragma once
// Chi-squared and means of readings whose covariance is in part scatter that few packings show.

#include <Eigen/Core>

namespace calib::inference {

/// What is known of the covariance that a chi-squared is taken by.
struct KnownFrom {
  double readings = 0;  ///< n
  /// Sum over the n whitened directions of the square of the scatter's share in their variance,
  /// tr((Sigma^-1 S)^2), [0, n].
  double scatter = 0;
  int packings = 0;  ///< that the scatter is known from; 0: the covariance is known

  KnownFrom& operator+=(const KnownFrom& other);
  /// Degrees of freedom of the covariance's size, (packings - 1) n / scatter [after Satterthwaite,
  /// Biometrics Bull. 2 (1946) 110]: infinite where it is known.
  double Freedom() const;
};

/// covariance: n x n, positive definite, of which scatter is a part.
KnownFrom WhatIsKnown(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& scatter,
                      int packings);

/// Chance of a chi-squared at least as large: Fisher's law of chi-squared over its `degrees` with
/// known.Freedom(), the chi-squared law where the covariance is known.
double UpperTail(double chi2, double degrees, const KnownFrom& known);

/// The same as a standard normal deviate [Paulson, Ann. Math. Stat. 13 (1942) 233; Wilson & Hilferty
/// 1931 where the covariance is known].
double NormalDeviate(double chi2, double degrees, const KnownFrom& known);

/// A mean over its standard deviation, as a standard normal deviate that is as rare: Student's law.
/// share: of scatter in the mean's variance, [0, 1].
double NormalDeviateOfMean(double ratio, double share, int packings);

}  // namespace calib::inference
