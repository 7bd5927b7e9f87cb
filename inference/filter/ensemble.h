#pragma once
// What ComputePosterior and FitProposal have in common: the samples of all iterations with their
// likelihood.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/sequential_filter.h"
#include "inference/filter/tempering.h"

namespace calib::inference {

/// The samples that the posterior rests on: those of all iterations, of the last one alone
/// (kEssTarget), or of the last ones that hold the same parameters (Proposal::frozen).
struct Ensemble {
  Eigen::Index first = 0;                     ///< samples of earlier iterations left out in front
  Eigen::Index last_size = 0;                 ///< samples of the last iteration
  Eigen::MatrixXd parameters;                 ///< N x d
  std::span<const Iteration> used;            ///< the iterations behind it, the caller's
  std::vector<std::optional<double>> frozen;  ///< of the last proposal
  Eigen::VectorXd log_start;  ///< N, ln prior / proposal; -inf: diverged or outside the prior
  Eigen::MatrixXd
      increments;  ///< N x T, ln p(y_t | earlier, sample); NaN from where a diverged sample ends
  Eigen::VectorXd log_likelihood;  ///< N; -inf: diverged
  Eigen::Index diverged = 0;       ///< how many
  Eigen::Index outside = 0;        ///< undiverged samples outside the prior's support
  /// Samples outside the prior's support of iterations without log_proposal, which count as draws
  /// from the prior: a table made for a wider one.
  Eigen::Index strangers = 0;
  std::optional<double> sigma;  ///< kEssTarget
  Tempering tempering;          ///< kEssTarget: how sigma was found (exponent = 1 / sigma)
};

/// Validates everything and evaluates. Errors as documented on ComputePosterior.
absl::StatusOr<Ensemble> MakeEnsemble(const JointPrior& priors, const DataSet& data,
                                      const FilterOptions& options,
                                      std::span<const Iteration> iterations);

/// Increments of all samples of some iterations, one below the other.
Eigen::MatrixXd IncrementsOf(const GaussianLikelihood& likelihood,
                             std::span<const Iteration> iterations, bool reversed);

/// The likelihood that the ensemble's increments come from, of readings in some order.
absl::StatusOr<GaussianLikelihood> LikelihoodOf(const Ensemble& ensemble, const DataSet& data,
                                                const FilterOptions& options);

/// Ranges of equal (experiment, load_step) in processing order.
StepOffsets LoadSteps(const DataSet& data);

}  // namespace calib::inference
