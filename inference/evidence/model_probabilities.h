#pragma once
// Bayesian comparison of models from estimates of their evidence on the same data.

#include <span>
#include <vector>

#include "inference/evidence/importance_evidence.h"

namespace calib::inference {

/// One of several models, compared by their evidences Z.
struct ModelProbability {
  /// Posterior probability of the model, all equally probable before: Z_k / sum_j Z_j, averaged
  /// over what is not known of the evidences. Sums to one over the models.
  double probability = 0;
  double q05 = 0, q95 = 0;         ///< 5 and 95 % quantiles of Z_k / sum_j Z_j
  double log_bayes_factor = 0;     ///< ln Z_k - ln Z_best, 0 for the best (the first of equals)
  double log_bayes_factor_se = 0;  ///< standard error, sqrt(se_k^2 + se_best^2); 0 for the best
};

/// Compares models by the evidence of the same data, in the order given. Errors of ln Z are taken
/// as independent and normal; averages and quantiles are over 10 000 fixed draws of them, so that
/// equal input gives equal bits. Pure.
/// in: finite values, standard errors >= 0; none: no models
std::vector<ModelProbability> ModelProbabilities(std::span<const EvidenceEstimate> evidence);

}  // namespace calib::inference
