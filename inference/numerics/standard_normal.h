#pragma once
// The standard normal distribution, accurate in relative terms to the far tails: phi its density,
// Phi its distribution function. Pure functions; never fail.

namespace calib::inference {

/// ln phi(x) = -x^2/2 - ln(2 pi)/2.
double LogNormalDensity(double x);

/// ln Phi(x) for any x, +-infinity included: by erfc where it does not underflow, below x = -37 by
/// the asymptotic series
///   Phi(x) ~ phi(x)/|x| (1 - 1/x^2 + 3/x^4 - 15/x^6 + ...)         [Abramowitz & Stegun 26.2.12]
double LogNormalCdf(double x);

/// ln (Phi(b) - Phi(a)) for a <= b, +-infinity included; -infinity for a == b. The difference is
/// taken in the tail where it does not cancel, for narrow intervals from the density at the middle.
double LogNormalMass(double a, double b);

/// x with ln Phi(x) = log_p, log_p <= 0. For a probability p above one half prefer
/// -NormalQuantileFromLog(ln(1 - p)), which keeps the digits of 1 - p.
double NormalQuantileFromLog(double log_p);

/// x with Phi(x) = u, u in (0, 1).
double NormalQuantile(double u);

}  // namespace calib::inference
