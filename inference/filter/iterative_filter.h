#pragma once
// Iterative Bayesian filter [Cheng 2019] as pure functions of what has been computed so far; sqmc [Cheng 2018] is its
// first iteration alone. Where we depart from the paper (weights, proposals, noise): README.md of this folder.

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/prior/prior.h"

namespace calib::inference {

enum class Design { kHalton, kSobol };

struct FilterOptions {
  NoiseMode noise = NoiseMode::kGiven;
  double ess_target = 0.2;          ///< (0, 1): effective sample size of the tempered weights that shape the next proposal (and of kEssTarget itself)
  double tolerance = 1e-2;          ///< relative change of every posterior mean at which iterations end [Table 1, step 7]
  double defensive_share = 0.1;     ///< share of the prior in every later proposal, [0, 1)
  int max_components = 10;          ///< truncation of the Dirichlet process
  double concentration = 0.01;      ///< its precision alpha [Cheng 2019, sec. 3.5]
  Design design = Design::kHalton;  ///< first iteration
  std::uint64_t seed = 0;
  absl::Status Validate() const;
};

/// Density from which the samples of one iteration are drawn: the prior alone (no mixture: iteration 0), or
/// (1 - defensive_share) * mixture truncated to the prior's support + defensive_share * prior.
/// Means and covariances are in standardised coordinates (Prior::ToStandard).
struct Proposal {
  struct Component {
    double weight = 0;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
  };
  std::vector<Component> components;
  double defensive_share = 0;
  double log_acceptance = 0;        ///< ln of the mixture's mass inside the support
};

/// One finished iteration: N samples of d parameters, predictions of the T readings.
struct Iteration {
  Proposal proposal;
  Eigen::MatrixXd parameters;       ///< N x d
  Eigen::MatrixXd predictions;      ///< N x T; a row with any NaN is a diverged sample: weight zero
  /// ln density from which each sample was really drawn, for runs made elsewhere; replaces the proposal's.
  std::optional<Eigen::VectorXd> log_proposal;
};

/// Draws n samples (n x d). Deterministic in (options.seed, iteration, sample index): row i does not depend on n for
/// iteration > 0. Errors: FAILED_PRECONDITION when a mixture has next to no mass inside the support.
absl::StatusOr<Eigen::MatrixXd> DrawSamples(const Proposal& proposal, std::span<const Prior> priors,
                                            const FilterOptions& options, int iteration, int n);

/// ln of the density of the proposal at each row of parameters, in the units of the parameters.
Eigen::VectorXd LogDensity(const Proposal& proposal, std::span<const Prior> priors, const Eigen::MatrixXd& parameters);

struct ParameterSummary {
  double mean = 0, sd = 0, cov = 0;         ///< cov = sd / |mean|
  double q05 = 0, q50 = 0, q95 = 0;
  bool at_bound = false;                    ///< more than a tenth of the posterior lies in the outer 2 % of the prior (by prior probability) at one end
};

/// The posterior along the readings: after load step s of the processing order. Rows: steps.
struct PosteriorPath {
  std::vector<int> experiment, load_step;   ///< S entries
  Eigen::MatrixXd mean, cov;                ///< S x d
  Eigen::VectorXd ess;                      ///< S, in (0, 1]
};

struct Posterior {
  Eigen::VectorXd log_weights;              ///< normalised, over the samples of all iterations in order; -inf: diverged
  std::vector<ParameterSummary> parameters;
  Eigen::MatrixXd correlation;              ///< d x d
  double log_evidence = 0;                  ///< ln p(data), proper Gaussian normalisation
  double log_evidence_se = 0;               ///< its standard error from the spread of the weights (delta method)
  double ess = 0;                           ///< effective number of samples (not a fraction)
  double pareto_k = 0;                      ///< tail index of the importance weights; > 0.7: the weights cannot be trusted
  std::optional<double> sigma;              ///< kEssTarget: the sigma found
  PosteriorPath path;
  std::vector<std::string> warnings;        ///< whole sentences: weight degeneracy and what to do, ...
};

/// Posterior from all iterations together: weight ∝ prior x likelihood / deterministic mixture of all proposals, so
/// that the data count once. kEssTarget uses the last iteration alone, as the paper does.
/// Errors: FAILED_PRECONDITION when no sample has a finite weight (all diverged).
absl::StatusOr<Posterior> ComputePosterior(std::span<const Prior> priors, const DataSet& data,
                                           const FilterOptions& options, std::span<const Iteration> iterations);

/// Proposal of the next iteration: variational Dirichlet-process mixture fitted to the tempered weights.
absl::StatusOr<Proposal> FitProposal(std::span<const Prior> priors, const DataSet& data, const FilterOptions& options,
                                     std::span<const Iteration> iterations);

/// True when every posterior mean moved by less than options.tolerance relative to the one before [Table 1, step 7].
bool MeansConverged(const Posterior& before, const Posterior& now, const FilterOptions& options);

/// Log weights of the samples of the running iteration from the readings that have arrived, for the live view: only
/// load steps that every undiverged sample has reached count. predictions: NaN where not yet reached.
struct OnlineView {
  int readings = 0;                         ///< readings that count
  double ess = 0;                           ///< effective number of samples
  int best = -1;                            ///< sample with the largest likelihood
  double best_rms = 0;                      ///< root mean square of its residuals over sd
};
OnlineView ViewOnline(const DataSet& data, const FilterOptions& options, const Eigen::MatrixXd& predictions,
                      std::span<const char> diverged);

}  // namespace calib::inference
