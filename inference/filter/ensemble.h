#pragma once
// What ComputePosterior and FitProposal have in common: the samples of all iterations with their
// likelihood. Pure functions.

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
  Eigen::Index first = 0;                     ///< samples of earlier iterations that are left out
  Eigen::Index last_size = 0;                 ///< samples of the last iteration
  Eigen::MatrixXd parameters;                 ///< N x d, in the parameters' units
  std::span<const Iteration> used;            ///< the iterations of these samples, the caller's
  std::vector<std::optional<double>> frozen;  ///< Proposal::frozen of the last iteration
  Eigen::VectorXd log_start;  ///< N, ln prior / proposal; -infinity: diverged or outside the prior
  Eigen::MatrixXd
      increments;  ///< N x T, ln p(y_t | earlier, sample); NaN from where a diverged sample ends
  Eigen::VectorXd log_likelihood;  ///< N; -infinity: diverged
  Eigen::Index diverged = 0;       ///< samples with a prediction that is not finite
  Eigen::Index aside = 0;          ///< of which nothing is known
  Eigen::Index outside = 0;        ///< undiverged samples outside the prior's support
  /// Samples outside the prior's support of iterations without log_proposal, which count as draws
  /// from the prior: a table of runs that was made for a wider one; samples that were drawn from no
  /// density, and those set aside. Their weight is zero, and the evidence is a mean without them.
  Eigen::Index strangers = 0;
  std::optional<double> sigma;  ///< kEssTarget alone: the sigma found
  Tempering tempering;          ///< kEssTarget alone: how it was found (exponent = 1 / sigma)
};

/// Validates everything and evaluates the likelihood of all samples. Errors: those of
/// ComputePosterior (iterative_filter.h). The result refers to `iterations`.
absl::StatusOr<Ensemble> MakeEnsemble(const JointPrior& priors, const DataSet& data,
                                      const FilterOptions& options,
                                      std::span<const Iteration> iterations);

/// ln p(y_t | earlier readings, sample) of all N samples of some iterations, one below the other,
/// N x T. reversed: the likelihood is of readings in reversed order.
Eigen::MatrixXd IncrementsOf(const GaussianLikelihood& likelihood,
                             std::span<const Iteration> iterations, bool reversed);

/// The likelihood by which the ensemble's samples are judged, of its readings in the order of
/// `data`: the ensemble's own or that of Reversed(data). Errors: those of
/// GaussianLikelihood::Create.
absl::StatusOr<GaussianLikelihood> LikelihoodOf(const Ensemble& ensemble, const DataSet& data,
                                                const FilterOptions& options);

/// The ranges of readings with equal (experiment, load_step), in processing order.
StepOffsets LoadSteps(const DataSet& data);

}  // namespace calib::inference
