#pragma once
// The standard normal distribution, accurate in relative terms to the far tails. Pure functions;
// never fail.

namespace calib::inference {

/// ln phi(x) = -x^2/2 - ln(2 pi)/2.
double LogNormalDensity(double x);

/// ln Phi(x) for any x, +-infinity included: erfc where it does not underflow, below -37 the
/// asymptotic series
///   Phi(x) ~ phi(x)/|x| (1 - 1/x^2 + 3/x^4 - 15/x^6 + ...)         [Abramowitz & Stegun 26.2.12]
double LogNormalCdf(double x);

/// ln (Phi(b) - Phi(a)), a <= b; the difference is taken in the tail where it does not cancel, and
/// for narrow intervals from the density at the middle. -inf for a == b.
double LogNormalMass(double a, double b);

/// x with ln Phi(x) = log_p, log_p <= 0. For a probability above one half prefer
/// -NormalQuantileFromLog(ln(1 - p)).
double NormalQuantileFromLog(double log_p);

/// x with Phi(x) = u, u in (0, 1).
double NormalQuantile(double u);

}  // namespace calib::inference
