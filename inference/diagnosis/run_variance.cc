#include "inference/diagnosis/run_variance.h"

#include <cmath>
#include <utility>

#include "calib/return_if_error.h"

namespace calib::inference {
namespace {

// Log density of runs left out, up to a constant, at the scale of each coordinate's variance that
// makes it largest: with other weights the variance of a run without effects is another one.
double LeftOutDensity(const LeftOutRuns& left_out) {
  const auto n = static_cast<double>(left_out.error.rows());
  double result = 0;
  for (Eigen::Index c = 0; c < left_out.error.cols(); ++c) {
    const auto variance = left_out.variance.col(c).array();
    const double scale = (left_out.error.col(c).array().square() / variance).mean();
    result -= 0.5 * (n * std::log(scale) + variance.log().sum());
  }
  return result;
}

}  // namespace

absl::StatusOr<FeatureEmulator> FitWithRunVariance(const EffectFeatures& features,
                                                   const EmulatorData& data,
                                                   FeatureEmulatorOptions options) {
  options.run_variance = {};
  ASSIGN_OR_RETURN(FeatureEmulator best, FeatureEmulator::Fit(features, data, options));
  options.start = best.variances();
  RunVariance found;
  double density = LeftOutDensity(best.left_out());
  // The likelihood of one number over hundreds of runs is flat within a factor of three.
  for (const double single : {0.0, 0.01, 0.03, 0.1, 0.3}) {
    for (const double pair : {0.0, 0.003, 0.01, 0.03, 0.1}) {
      if (single == 0 && pair == 0) continue;
      FeatureEmulatorOptions held = options;
      held.hold = true;
      held.run_variance = {.single = single, .pair = pair};
      ASSIGN_OR_RETURN(const FeatureEmulator tried, FeatureEmulator::Fit(features, data, held));
      const double other = LeftOutDensity(tried.left_out());
      if (other > density) {
        density = other;
        found = held.run_variance;
      }
    }
  }
  if (found.single == 0 && found.pair == 0) return best;
  options.run_variance = found;
  return FeatureEmulator::Fit(features, data, options);
}

}  // namespace calib::inference
