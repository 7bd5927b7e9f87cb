// Every valid prior, however narrow, wide or far truncated, is one distribution seen through all
// its functions.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "inference/prior/prior.h"

namespace calib::inference {
namespace {

// A real number in [low, high], uniform.
rc::Gen<double> Real(double low, double high) {
  return rc::gen::map(
      rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 40),
      [=](std::int64_t k) { return low + (high - low) * static_cast<double>(k) * 0x1p-40; });
}

Prior SomePrior() {
  const auto kind = static_cast<PriorKind>(*rc::gen::inRange(0, 4));
  Prior prior{.kind = kind, .mean = *Real(-3, 3), .sd = *Real(0.01, 2)};
  const double start = *Real(-6, 6);
  const double width = std::exp(*Real(-4, 2));
  const bool log = kind == PriorKind::kLogUniform || kind == PriorKind::kLogNormal;
  const bool bounded =
      kind == PriorKind::kUniform || kind == PriorKind::kLogUniform || *rc::gen::arbitrary<bool>();
  if (bounded) {
    prior.min = log ? std::exp(start) : start;
    prior.max = log ? std::exp(start + width) : start + width;
  }
  return prior;
}

RC_GTEST_PROP(Prior, QuantileRisesAndStaysInTheSupport, ()) {
  const Prior prior = SomePrior();
  RC_PRE(prior.Validate().ok());
  const double u = *Real(1e-9, 1 - 1e-6);
  const double x = prior.Quantile(u);
  const double next = prior.Quantile(u + 0.5 * (1 - u));
  RC_ASSERT(prior.InSupport(x));
  RC_ASSERT(x <= next);
  RC_ASSERT(std::isfinite(prior.LogDensity(x)));
}

// Slope of the quantile function times density: one. The step is relative to the nearer end of (0,
// 1).
RC_GTEST_PROP(Prior, QuantileInvertsTheDensity, ()) {
  const Prior prior = SomePrior();
  RC_PRE(prior.Validate().ok());
  const double u = *Real(0.01, 0.99);
  const double h = 1e-4 * std::min(u, 1 - u);
  const double slope = (prior.Quantile(u + h) - prior.Quantile(u - h)) / (2 * h);
  RC_ASSERT(std::abs(std::log(slope) + prior.LogDensity(prior.Quantile(u))) < 1e-4);
}

RC_GTEST_PROP(Prior, StandardCoordinateIsAMonotoneRoundTrip, ()) {
  const Prior prior = SomePrior();
  RC_PRE(prior.Validate().ok());
  const double low = prior.Quantile(0.1);
  const double high = prior.Quantile(0.9);
  RC_ASSERT(prior.ToStandard(low) < prior.ToStandard(high));
  RC_ASSERT(std::abs(prior.FromStandard(prior.ToStandard(low)) - low) <=
            1e-12 * (std::abs(low) + std::abs(high)));
  RC_ASSERT(prior.StandardDeviation() > 0);
}

}  // namespace
}  // namespace calib::inference
