#include "inference/evidence/importance_evidence.h"

#include <cmath>
#include <limits>

#include "inference/numerics/log_weights.h"

namespace calib::inference {

EvidenceEstimate ImportanceEvidence(const Eigen::VectorXd& log_weights) {
  const auto n = static_cast<double>(log_weights.size());
  const double ess = EffectiveSampleSize(log_weights);
  if (ess == 0 || n < 2) {
    return {.log_evidence = LogSumExp(log_weights) - std::log(n),
            .standard_error = std::numeric_limits<double>::infinity()};
  }
  return {.log_evidence = LogSumExp(log_weights) - std::log(n),
          .standard_error = std::sqrt(std::max(n / ess - 1, 0.0) / (n - 1))};
}

}  // namespace calib::inference
