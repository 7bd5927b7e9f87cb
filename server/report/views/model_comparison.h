#pragma once
// Bayesian comparison of campaigns on the same data.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "inference/evidence/model_probabilities.h"
#include "server/campaign/model/campaign.h"

namespace calib::report {

/// A campaign with the posterior after its last complete iteration.
struct RivalModel {
  campaign::Campaign campaign;
  v1::Posterior posterior;
};

struct ComparedModel {
  std::string campaign, name;
  double log_evidence = 0, log_evidence_se = 0;
  inference::ModelProbability probability;
};

struct ModelComparison {
  std::vector<ComparedModel> models;  ///< the most probable first
  std::vector<std::string> warnings;  ///< whole sentences
};

/// All models are equally probable before. Errors, one sentence each: INVALID_ARGUMENT for fewer
/// than two campaigns or one named twice; FAILED_PRECONDITION when they were not fitted to the same
/// readings (campaign::DataDigest) or one has no evidence: no posterior, or errors tempered to an
/// effective sample size.
absl::StatusOr<ModelComparison> CompareModels(const std::vector<RivalModel>& rivals);

}  // namespace calib::report
