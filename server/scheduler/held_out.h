#pragma once
// For which samples held-out experiments are run: those that carry the posterior.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace calib::scheduler {

/// Most samples that held-out experiments are run for.
inline constexpr std::size_t kHeldOutRuns = 20;

/// log_weights: normalised, of all samples. Positions of the samples with the largest weights
/// (ties: the earlier sample), no more than hold 99 % of the weight.
std::vector<std::size_t> Heaviest(const std::vector<double>& log_weights);

/// Positions, ascending, of the samples on which kHeldOutRuns evenly spaced shares of the weight
/// fall.
std::vector<std::size_t> EvenlyByWeight(const std::vector<double>& log_weights);

/// Rows of draws (n x d), evenly spaced in their order: `most` or kHeldOutRuns of them, or all.
Eigen::MatrixXd EvenlySpaced(const Eigen::MatrixXd& draws, std::size_t most);

}  // namespace calib::scheduler
