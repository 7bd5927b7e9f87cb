#include "inference/adaptive/known_region.h"

#include <cmath>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/numerics/standard_normal.h"

namespace calib::inference {

using Eigen::Index;

absl::StatusOr<KnownRegion> KnownRegion::Fit(const Eigen::MatrixXd& standard,
                                             const AdaptiveRuns& runs) {
  constexpr Index kLeastBad = 2;  // runs: a machine's single fault bounds nothing
  Eigen::VectorXd good(runs.rows());
  for (Index i = 0; i < runs.rows(); ++i) {
    const RunEnd end = runs.end[static_cast<std::size_t>(i)];
    good[i] = end == RunEnd::kComplete || end == RunEnd::kEarly ? 1 : 0;
  }
  KnownRegion result;
  if (good.size() - good.sum() < kLeastBad || good.size() < 4) return result;
  ASSIGN_OR_RETURN(auto process, GaussianProcess::Fit(standard, good));
  result.process_ = std::move(process);
  return result;
}

Eigen::VectorXd KnownRegion::LogProbability(const Eigen::MatrixXd& standard) const {
  if (!process_) return Eigen::VectorXd::Zero(standard.rows());
  const GaussianProcessPrediction at = process_->Predict(standard);
  Eigen::VectorXd result(standard.rows());
  for (Index i = 0; i < result.size(); ++i) {
    const double sd = std::sqrt(at.variance[i] + process_->scatter_variance());
    result[i] = LogNormalCdf((at.mean[i] - 0.5) / std::max(sd, 1e-6));
  }
  return result;
}

}  // namespace calib::inference
