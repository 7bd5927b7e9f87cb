#pragma once
// One parameter of a weighted sample in the numbers that reports show.

#include <Eigen/Dense>

#include "inference/filter/iterative_filter.h"
#include "inference/prior/prior.h"

namespace calib::inference {

/// Weights as normalised logs; variance is the plain weighted one (no small-sample correction).
ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values);

}  // namespace calib::inference
