#pragma once
// Sizes of grains by a grading curve, as sieves give it: the share of the mass that is finer.

#include <vector>

namespace calib::dem {

/// One point of a grading curve.
struct GradingPoint {
  double radius = 0;  ///< [m] > 0
  double finer = 0;   ///< share of the mass in grains of smaller radius, 0 .. 1
};

/// A grading curve. Between two points the mass is spread evenly over ln r, as a straight line of
/// the usual semi-logarithmic plot says. Radii increase, shares do not fall, from 0 at the first
/// point to 1 at the last.
using Grading = std::vector<GradingPoint>;

/// Whether the points are a grading curve: at least two, radii increasing, shares not falling, from
/// 0 at the first point to 1 at the last.
bool IsGrading(const Grading& curve);

/// Radii [m] of `particles` (>= 1) grains that follow the curve, largest first. Grains are many
/// where their share of the mass is large and they are small, dN = dM / r^3. The distribution of
/// their number is cut into as many strata of equal number, and each grain has the mean mass of
/// its stratum: where two strata meet the mass that is finer is exactly the curve's, between by
/// less than the mass of one grain off. No draw is random. Precondition: IsGrading.
std::vector<double> GradedRadii(const Grading& curve, int particles);

/// Share of the mass of all grains that is in the largest of them [-]: what GradedRadii() misses
/// its curve by at most. radii: all grains, [m] > 0, at least one.
double LargestShare(const std::vector<double>& radii);

/// The curve of sizes whose logarithm is normal by mass: half of the mass is finer than `median`
/// [m] > 0, log_sd > 0 the standard deviation of ln r. Cut off at two standard deviations to either
/// side (the 4.6 % of the mass beyond spread over the rest), 41 points.
Grading LogNormalGrading(double median, double log_sd);

}  // namespace calib::dem
