#pragma once
// The values that a control goes through in a planned test.

#include <cstddef>
#include <vector>

namespace calib::diagnosis {

inline constexpr double kHalfWay = 0.5;  ///< of the way, where it is unloaded

/// From start (which is no reading) to last in 40 equal steps.
std::vector<double> Monotonic(double start, double last);

/// The same with an unloading by a tenth of the way, and the reloading, after that share of it,
/// [0.15, 0.7].
std::vector<double> WithUnloading(double start, double last, double share);

/// count values from low to high: of equal ratios where both are above 0, else of equal steps.
std::vector<double> Spread(double low, double high, std::size_t count);

}  // namespace calib::diagnosis
