#pragma once
// Rate of a mass that leaves or arrives, from looks at it.

#include <optional>
#include <vector>

namespace calib::dem {

/// Least-squares slope of `mass` [kg] over `time` [s] (of equal lengths) [kg/s], from the looks
/// whose mass lies within [low, high]. nullopt with fewer than `fewest` of them (at least 2) or
/// where they were made at one time.
std::optional<double> SlopeBetween(const std::vector<double>& time, const std::vector<double>& mass,
                                   double low, double high, int fewest);

}  // namespace calib::dem
