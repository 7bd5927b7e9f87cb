#pragma once
// One parameter of a weighted sample in the numbers that reports show.

#include <Eigen/Core>

#include "inference/filter/iterative_filter.h"
#include "inference/prior/prior.h"

namespace calib::inference {

/// |sd / mean|; NaN where the mean is zero.
double CoefficientOfVariation(double mean, double sd);

/// Weights as normalised logs; variance is the plain weighted one (no small-sample correction).
/// at_bound: at a finite bound alone; InTail has the others.
ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values);

/// The same of the end where the prior has no bound: whether a tenth of the posterior, by its 5 %, 50
/// % and 95 % quantiles (that of 10 % on the normal through two of them, in the prior's standardised
/// coordinate), lies in the outer 2 % of the prior's probability. False where a quantile is NaN.
bool InTail(const Prior& prior, const ParameterSummary& summary);

}  // namespace calib::inference
