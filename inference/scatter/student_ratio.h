#pragma once

namespace calib::inference {

/// By how much wider the range from 5 to 95 % is where a standard deviation is known from so many
/// degrees of freedom only: quantiles of Student's t over those of the normal law. freedom > 0.
double StudentRatio(double freedom);

}  // namespace calib::inference
