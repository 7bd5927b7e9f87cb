#pragma once
// Bayesian comparison of campaigns on the same data.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "inference/evidence/model_probabilities.h"
#include "server/campaign/model/campaign.h"
#include "server/report/views/stored_diagnosis.h"

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
  std::string evidence_from{"posterior"};  ///< of each campaign, or "diagnosis" of their base
  std::vector<ComparedModel> models;       ///< the most probable first
  std::vector<std::string> warnings;       ///< whole sentences
};

/// The campaign that all others are extensions of, one after the other or each by itself; empty:
/// there is none.
std::string BaseOf(const std::vector<RivalModel>& rivals);

/// All models are equally probable before. Where one has no posterior and all but one are
/// extensions of that one, their evidences are those of the latest of its diagnoses that tried
/// effects. Errors, one sentence each: INVALID_ARGUMENT for fewer than two campaigns or one named
/// twice; FAILED_PRECONDITION when they were not fitted to the same readings
/// (campaign::DataDigest) or one has no evidence: errors tempered to an effective sample size, or
/// no posterior and no place in such a diagnosis.
absl::StatusOr<ModelComparison> CompareModels(const std::vector<RivalModel>& rivals,
                                              const std::vector<StoredDiagnosis>& diagnoses = {});

}  // namespace calib::report
