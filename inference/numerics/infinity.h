#pragma once

#include <limits>

namespace calib::inference {

/// Open ends of intervals; -kInfinity is the logarithm of a weight of zero.
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace calib::inference
