#pragma once
// Special functions and the probability laws built on them. They are Boost.Math's, instantiated in
// one source file: its templates cost seconds in every file that includes them.
//
// Pure functions. An argument outside the stated range is a bug of the caller; Boost then throws.

namespace calib::inference {

/// Regularised upper incomplete gamma function Q(a, x) = Gamma(a, x) / Gamma(a), in [0, 1]: the
/// chance that a gamma variable of shape a and rate 1 exceeds x; a chi-squared with k degrees of
/// freedom exceeds x with chance Q(k / 2, x / 2).            [Abramowitz & Stegun 6.5.3, 26.4.19]
/// in: shape a > 0, x >= 0
double GammaQ(double shape, double x);

/// Regularised upper incomplete gamma function Q(a, x) as GammaQ, computed in double alone where
/// GammaQ computes in long double: the last digits differ, and it takes a fraction of the time.
/// in: shape a > 0, x >= 0
double GammaQInDouble(double shape, double x);

/// x with GammaQ(shape, x) = q.
/// in: shape > 0, q in (0, 1]
double GammaQInverse(double shape, double q);

/// x with 1 - GammaQ(shape, x) = p, p kept with its digits where it is tiny.
/// in: shape > 0, p in [0, 1)
double GammaPInverse(double shape, double p);

/// Gamma(a) / Gamma(a + delta), without the cancellation of a difference of two logarithms.
/// in: a > 0, a + delta > 0
double GammaRatio(double a, double delta);

/// ln Gamma(x), computed in double alone.
/// in: x > 0
double LogGamma(double x);

/// The derivative psi(x) of ln Gamma(x), computed in double alone.
/// in: x > 0
double Digamma(double x);

/// z that a standard normal variable exceeds with this chance, in (0, 1). It computes in long
/// double: its last digits differ from those of NormalQuantile (standard_normal.h).
double NormalTailQuantile(double chance);

/// Fisher's law: of the ratio of two independent chi-squareds, each over its degrees of freedom.
struct FisherLaw {
  double numerator = 1;    ///< degrees of freedom, > 0
  double denominator = 1;  ///< degrees of freedom, > 0

  double Tail(double ratio) const;           ///< chance that it exceeds `ratio` >= 0
  double TailQuantile(double chance) const;  ///< what it exceeds with this chance, in (0, 1)
};

/// Student's law with this many degrees of freedom.
struct StudentLaw {
  double freedom = 1;  ///< > 0

  double Tail(double t) const;               ///< chance that it exceeds t
  double TailQuantile(double chance) const;  ///< what it exceeds with this chance, in (0, 1)
};

/// By how much wider the interval from the 5 % to the 95 % quantile is where a standard deviation
/// is known from `freedom` > 0 degrees of freedom only: Student's quantile over the normal one.
double StudentRatio(double freedom);

/// Student's quantile over the normal one, both of the value that is exceeded with chance `tail`,
/// in [0, 0.5]; freedom > 0. Infinite for tail 0; for tail 0.5, where both are 0, the limit, which
/// is the ratio of the densities at the median.
double StudentRatio(double freedom, double tail);

}  // namespace calib::inference
