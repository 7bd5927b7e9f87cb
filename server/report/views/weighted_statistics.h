#pragma once
// Statistics of weighted samples. Values that are NaN, and weights that are not positive, do not
// count.

#include <span>
#include <vector>

namespace calib::report {

/// NaN when nothing counts.
double WeightedMean(std::span<const double> values, std::span<const double> weights);

/// Smallest value at which the share of the weight reaches `probability`; NaN when nothing counts.
double WeightedQuantile(std::span<const double> values, std::span<const double> weights,
                        double probability);

/// The same of several probabilities, ascending.
std::vector<double> WeightedQuantiles(std::span<const double> values,
                                      std::span<const double> weights,
                                      std::span<const double> probabilities);

/// Share of the weight in each of `bins` equal intervals of [min, max], as a density (integrates to
/// one over the range).
std::vector<double> WeightedHistogram(std::span<const double> values,
                                      std::span<const double> weights, double min, double max,
                                      int bins);

}  // namespace calib::report
