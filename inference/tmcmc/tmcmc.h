#pragma once
// Transitional Markov chain Monte Carlo [Ching & Chen 2007; Hadjidoukas 2014, sec. 3.1]: a
// population is carried from the prior to the posterior through prior x likelihood^exponent,
// exponent from 0 to 1, and leaves the evidence behind. From another density q it goes through
//   q^(1 - exponent) (prior x likelihood)^exponent,
// to the same posterior and evidence. It departs from the papers in the steps per stage, the spread
// of the weights and the standard error, as the options and functions say.

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// Options of a run. Defaults that depart from the paper are those with which the mean error of the
/// log evidence is at most 0.014 over five reference problems (measured by
/// inference_tmcmc_data_test).
struct TmcmcOptions {
  int samples = 1000;  ///< population N, [20, 1e6]
  /// Coefficient of variation of a stage's weights, (0, 2]; Ching & Chen take 1.
  double target_cv = 0.5;
  int steps = 0;  ///< Metropolis steps per stage; 0: StepsPerStage decides; Ching & Chen take 1
  /// Share of accepted steps that the proposal's scale is steered to, (0, 1).
  double acceptance = 0.3;
  int max_stages = 200;  ///< >= 1
  std::uint64_t seed = 0;
  /// q, where the population begins: the prior where it has no mixture or is the prior by all of
  /// its share. Holds no parameter.
  Proposal first = {};
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// Metropolis steps of a stage: options.steps, or where that is 0 three for each of d parameters,
/// at least ten. A random walk forgets where it came from in a number of steps that grows with d.
int StepsPerStage(const TmcmcOptions& options, std::size_t d);

/// One finished stage, the move from one exponent to the next.
struct TmcmcStage {
  double exponent = 0;    ///< reached, in (0, 1]
  double cv = 0;          ///< coefficient of variation of the weights that led there
  double acceptance = 0;  ///< share of accepted Metropolis steps, over all steps of the stage
};

/// Everything a run is at one moment, plain values: store it after any advance, go on from it
/// elsewhere, and the result has the same bits. Parameters are in their own units.
struct TmcmcState {
  Eigen::MatrixXd samples;         ///< N x d, at `exponent`; empty before the first advance
  Eigen::VectorXd log_prior;       ///< N, in standardised coordinates
  Eigen::VectorXd log_importance;  ///< N: ln (prior / q), 0 where it began at the prior
  Eigen::VectorXd log_likelihood;  ///< N; -infinity: diverged
  std::vector<int> ancestor;       ///< N: index of the first draw each sample descends from
  /// N: the evaluation that each sample is, all proposals of all batches counted in order from 0.
  std::vector<std::int64_t> origin;
  std::int64_t evaluated = 0;  ///< proposals whose likelihood was taken so far
  double exponent = 0;         ///< of the running stage, [0, 1]
  double scale = 0;            ///< of proposal_factor, FirstScale(d) at first
  /// d x d: lower Cholesky factor of the samples' weighted covariance, standardised coordinates.
  Eigen::MatrixXd proposal_factor;
  int step = 0;                    ///< Metropolis steps done in the running stage
  int accepted = 0;                ///< accepted moves in the running stage
  std::vector<TmcmcStage> stages;  ///< begun so far; the last one is running
  double log_evidence = 0;         ///< ln of the product of the mean weights so far

  Eigen::MatrixXd proposals;  ///< N x d, whose likelihood is wanted next; 0 rows once finished
  /// N: a proposal is accepted exactly if its log likelihood exceeds this (the uniform number is
  /// drawn first), so a run may be stopped as soon as its likelihood is known to stay below; pass
  /// -infinity for it then. +infinity: outside the prior's support, need not run at all. -infinity:
  /// needed in any case.
  Eigen::VectorXd accept_above;

  /// Whether the samples are draws from the posterior.
  bool finished() const { return exponent == 1 && proposals.rows() == 0; }
  /// Standard error of log_evidence: the variance of the product of mean weights is estimated from
  /// how many of the samples share an ancestor among the first draws [Lee & Whiteley 2018, Eq. 8],
  ///   V = 1 - (N / (N - 1))^(n + 1) (1 - sum_e (n_e / N)^2),  n stages, n_e descendants of draw e,
  /// which needs no independence within a stage, and not less than sum cv^2 / N, its value for
  /// perfect mixing.
  double LogEvidenceStandardError() const;
};

/// Begins a run: N draws from the prior, or from q, as first proposals. Every random number is a
/// function of (seed, stage, step, row): neither the order in which likelihoods arrive nor the
/// number of workers matters. Errors: INVALID_ARGUMENT (options, a prior, no parameter); those of
/// DrawSamples.
absl::StatusOr<TmcmcState> StartTmcmc(const JointPrior& priors, const TmcmcOptions& options);

/// Takes ln p(data | proposals), N entries in the order of state.proposals (NaN counts as
/// -infinity: a diverged run), and prepares the next batch; one call per Metropolis step. Once
/// state.finished() the samples are equally weighted draws from the posterior. Errors:
/// INVALID_ARGUMENT for a wrong number of entries or +infinity; FAILED_PRECONDITION when fewer than
/// two first draws have a likelihood, or after max_stages. The state is unchanged then.
absl::Status AdvanceTmcmc(const JointPrior& priors, const TmcmcOptions& options,
                          const Eigen::VectorXd& log_likelihood, TmcmcState& state);

/// ln p(data | parameters) of each row of an M x d matrix, M entries.
using BatchLogLikelihood = std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>;

/// A whole run in this thread: StartTmcmc and AdvanceTmcmc until it is finished. Errors: theirs;
/// CANCELLED once `stop` is requested, which is looked at before each batch.
absl::StatusOr<TmcmcState> RunTmcmc(const JointPrior& priors, const TmcmcOptions& options,
                                    const BatchLogLikelihood& log_likelihood,
                                    const std::stop_token& stop = {});

}  // namespace calib::inference
