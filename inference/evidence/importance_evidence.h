#pragma once
// Evidence of a model, the probability of its data, from importance weights. Pure functions.

#include <Eigen/Core>

namespace calib::inference {

/// An estimate of the evidence.
struct EvidenceEstimate {
  double log_evidence = 0;    ///< natural logarithm
  double standard_error = 0;  ///< of log_evidence; infinite when no sample has weight
};

/// ln (1/N sum_i W_i), W_i = prior x likelihood / proposal of sample i, and its standard error by
/// the delta method
///   se = sd(W) / (sqrt(N) mean(W)) = sqrt((N / ESS - 1) / (N - 1))              [Owen 2013, ch. 9]
/// The estimate of the evidence itself is unbiased; the error is that of independent draws, an
/// upper guide for quasi-random ones, and means nothing once the tail index of the weights
/// (ParetoTailIndex in pareto_tail.h) exceeds 0.7.
/// in: log_weights ln W_i of all N samples drawn, not normalised; -infinity: no likelihood
EvidenceEstimate ImportanceEvidence(const Eigen::VectorXd& log_weights);

}  // namespace calib::inference
