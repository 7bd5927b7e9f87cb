#pragma once
// One parameter of a weighted sample in the numbers that reports show.

#include <Eigen/Dense>

#include "inference/filter/iterative_filter.h"
#include "inference/prior/prior.h"

namespace calib::inference {

/// |sd / mean|; NaN where the mean is zero.
double CoefficientOfVariation(double mean, double sd);

/// Weights as normalised logs; variance is the plain weighted one (no small-sample correction).
ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values);

}  // namespace calib::inference
