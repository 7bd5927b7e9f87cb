#pragma once
// One parameter of weighted samples in the numbers that reports show. Pure functions.

#include <Eigen/Core>

#include "inference/filter/iterative_filter.h"
#include "inference/prior/prior.h"

namespace calib::inference {

/// |sd / mean|, the coefficient of variation; NaN where the mean is zero.
double CoefficientOfVariation(double mean, double sd);

/// Summary of the weighted values of one parameter under its prior. log_weights: n, logarithms of
/// weights that sum to one; values: n, in the parameter's unit. The variance is the plain weighted
/// one (no small-sample correction). at_bound speaks of finite bounds alone, InTail of the other
/// ends.
ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values);

/// Whether more than a tenth of a posterior lies in the outer 2 % of its prior's probability at an
/// end where the prior has no bound, by the posterior's 5 %, 50 % and 95 % quantiles (the 10 % and
/// 90 % ones are taken from normals through two of them, in the prior's standardised coordinate).
/// False where a quantile is NaN.
bool InTail(const Prior& prior, const ParameterSummary& summary);

}  // namespace calib::inference
