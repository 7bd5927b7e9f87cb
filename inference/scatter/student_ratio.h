#pragma once

namespace calib::inference {

/// By how much wider the range from 5 to 95 % is where a standard deviation is known from so many
/// degrees of freedom only: quantiles of Student's t over those of the normal law. freedom > 0.
double StudentRatio(double freedom);
/// The same of the quantile that so much probability lies beyond, `tail` in [0, 0.5]; infinite for
/// a tail of 0, the ratio of the densities at the median for 0.5.
double StudentRatio(double freedom, double tail);

}  // namespace calib::inference
