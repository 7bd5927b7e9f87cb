#pragma once
// Model evidence from importance weights.

#include <Eigen/Core>

namespace calib::inference {

struct EvidenceEstimate {
  double log_evidence = 0;
  double standard_error = 0;  ///< of log_evidence; infinite when no sample has weight
};

/// ln (1/N sum_i W_i), W_i = prior x likelihood / proposal, and its standard error by the delta
/// method
///   se = sd(W) / (sqrt(N) mean(W)) = sqrt((N / ESS - 1) / (N - 1))              [Owen 2013, ch. 9]
/// The estimate of the evidence itself is unbiased; the error is that of independent draws, an
/// upper guide for quasi-random ones, and means nothing once the Pareto index of the weights
/// exceeds 0.7.
/// in: log_weights ln W_i of all N samples drawn, -inf for those with no likelihood; not normalised
EvidenceEstimate ImportanceEvidence(const Eigen::VectorXd& log_weights);

}  // namespace calib::inference
