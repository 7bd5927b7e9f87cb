#include "inference/filter/parameter_summary.h"

#include <cmath>
#include <limits>
#include <vector>

#include "inference/numerics/infinity.h"
#include "inference/numerics/weighted_moments.h"

namespace calib::inference {
namespace {

// A posterior is at a bound where more than this share of it lies in this outer share of its prior;
// chosen: five times what the prior alone has there.
constexpr double kOuterShare = 0.02;  // of the prior's probability at one end
constexpr double kBoundShare = 0.1;   // of the posterior

double MassWhere(const Eigen::VectorXd& log_weights, const Eigen::VectorXd& values, double low,
                 double high) {
  double mass = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] >= low && values[i] <= high) mass += std::exp(log_weights[i]);
  }
  return mass;
}

}  // namespace

double CoefficientOfVariation(double mean, double sd) {
  return mean == 0 ? std::numeric_limits<double>::quiet_NaN() : sd / std::abs(mean);
}

ParameterSummary Summarize(const Prior& prior, const Eigen::VectorXd& log_weights,
                           const Eigen::VectorXd& values) {
  const Eigen::VectorXd mean = WeightedMean(log_weights, values);
  ParameterSummary summary;
  summary.mean = mean[0];
  summary.sd = std::sqrt(WeightedCovariance(log_weights, values, mean)(0, 0));
  summary.cov = CoefficientOfVariation(summary.mean, summary.sd);
  const std::vector<double> quantiles = WeightedQuantiles(log_weights, values, {0.05, 0.5, 0.95});
  summary.q05 = quantiles[0];
  summary.q50 = quantiles[1];
  summary.q95 = quantiles[2];
  summary.prior_sd = prior.StandardDeviation();
  const double low = prior.Quantile(kOuterShare);
  const double high = prior.Quantile(1 - kOuterShare);
  summary.at_bound =
      (std::isfinite(prior.min) && MassWhere(log_weights, values, -kInfinity, low) > kBoundShare) ||
      (std::isfinite(prior.max) && MassWhere(log_weights, values, high, kInfinity) > kBoundShare);
  return summary;
}

bool InTail(const Prior& prior, const ParameterSummary& summary) {
  constexpr double kTenth = 1.2816 / 1.6449;  // normal quantiles of 10 % over those of 5 %
  if (std::isnan(summary.q05) || std::isnan(summary.q50) || std::isnan(summary.q95)) return false;
  const double middle = prior.ToStandard(summary.q50);
  const double low = middle + kTenth * (prior.ToStandard(summary.q05) - middle);
  const double high = middle + kTenth * (prior.ToStandard(summary.q95) - middle);
  return (!std::isfinite(prior.min) && low < prior.ToStandard(prior.Quantile(kOuterShare))) ||
         (!std::isfinite(prior.max) && high > prior.ToStandard(prior.Quantile(1 - kOuterShare)));
}

}  // namespace calib::inference
