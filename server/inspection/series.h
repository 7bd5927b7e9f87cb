#pragma once
// What a measured curve shows by itself: how large its errors are, how coarse its numbers, where
// the test paused, and how many of its readings say something of their own.

#include <cstddef>
#include <optional>
#include <vector>

namespace calib::inspection {

/// One column against what drives the test. NaN: missing.
struct Curve {
  std::vector<double> control;         ///< n; the number of the reading where nothing drives it
  std::vector<double> values;          ///< n
  std::vector<std::size_t> turning{};  ///< readings at which the control turns back, ascending
};

/// Standard deviation of a reading's own error, in the unit of the column: what differences of
/// neighbours leave. Of second, third and fourth divided differences, weights normed to an error of
/// one, 1.4826 times the median of the sizes; the least of the three, since a curve only adds to
/// them and the less the higher they are [Gasser, Sroka & Jennen-Steinmetz, Biometrika 73 (1986)
/// 625]. The median is moved neither by bends nor by single outliers [Rousseeuw & Croux, JASA 88
/// (1993) 1273]. At least what rounding leaves, quantum / sqrt(12). NaN from fewer than five
/// readings in a row. Pure.
double NoiseOf(const Curve& curve);

/// The step in which the column's numbers stand; empty: finer than a thousandth of their range, or
/// fewer than five of them. Pure.
std::optional<double> QuantumOf(const std::vector<double>& values);

/// How many independent readings would say as much of the curve as these do: n over the integrated
/// autocorrelation time of what a smooth curve (locally quadratic, of a tenth of each branch)
/// leaves, the sum over lags cut where pairs turn negative [Geyer, Stat. Sci. 7 (1992) 473].
/// Between 1 and n; n where fewer than ten are in a branch. Pure.
double IndependentReadings(const Curve& curve);

/// Readings at which a stress falls and is back within three readings, as it does while a test
/// pauses: by more than six times its noise, or three times where the control stands still.
/// Ascending. Pure.
/// in: noise, of the curve, >= 0; a curve without any has no dips
std::vector<std::size_t> DipsOf(const Curve& curve, double noise);

}  // namespace calib::inspection
