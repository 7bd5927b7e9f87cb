#pragma once
// Iterative Bayesian filter [Cheng 2019] as pure functions of what has been computed so far; sqmc
// [Cheng 2018] is its first iteration alone. Where we depart from the paper (weights, proposals,
// noise): README.md of this folder.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/mixture/gaussian_mixture.h"
#include "inference/prior/joint_prior.h"
#include "inference/scatter/chi_squared_law.h"

namespace calib::inference {

/// kSymmetricLatinHypercube: the maximin one of 1000 [Samuelsson 2023, sec. 3.2].
enum class Design { kHalton, kSobol, kLatinHypercube, kSymmetricLatinHypercube };

/// What the mixture of the next proposal is fitted to: the parameters, or the parameters joint with
/// the states of their runs [Cheng 2019, sec. 3.2: the augmented state], see joint_states.h. The
/// proposal is its density of the parameters either way.
enum class MixtureOver { kParameters, kParametersAndStates };

struct FilterOptions {
  NoiseMode noise = NoiseMode::kGiven;
  /// (0, 1): effective sample size, as a share of the samples of one iteration, of the tempered
  /// weights that shape the next proposal (and of kEssTarget itself) [Cheng 2019, Table 1, step 4].
  double ess_target = 0.2;
  double tolerance = 1e-2;  ///< > 0; relative change of the means that ends it [Table 1, step 7]
  double defensive_share = 0.1;  ///< share of the prior in every later proposal, [0, 1)
  int max_components = 10;       ///< >= 1; truncation of the Dirichlet process
  double concentration = 0.01;   ///< > 0; its precision alpha [Cheng 2019, sec. 3.5]
  MixtureOver mixture = MixtureOver::kParameters;
  Design design = Design::kHalton;  ///< first iteration
  bool reversed_path = false;       ///< also give the path with the readings in reversed order
  std::uint64_t seed = 0;
  /// INVALID_ARGUMENT naming the field, what was found and what is allowed.
  absl::Status Validate() const;
};

/// Density from which the samples of one iteration are drawn: the prior alone (no mixture:
/// iteration 0), or (1 - defensive_share) * mixture truncated to the prior's support +
/// defensive_share * prior. Means and covariances are in standardised coordinates
/// (Prior::ToStandard).
struct Proposal {
  using Component = MixtureComponent;
  std::vector<Component> components;
  double defensive_share = 0;
  double log_acceptance = 0;  ///< ln of the mixture's mass inside the support
  /// Empty, or d entries: parameters held at a value, in their own unit [Cheng 2019, sec. 6.2]. The
  /// mixture is then one of the others, in their order. Independent, unconstrained priors only.
  std::vector<std::optional<double>> frozen = {};
};
/// Whether both hold the same parameters at the same values.
bool SameFrozen(const Proposal& a, const Proposal& b);

/// One finished iteration: N samples of d parameters, predictions of the T readings.
struct Iteration {
  Proposal proposal;
  Eigen::MatrixXd parameters;   ///< N x d
  Eigen::MatrixXd predictions;  ///< N x T; a row with any NaN is a diverged sample: weight zero
  /// ln density from which each sample was really drawn, for runs made elsewhere; replaces the
  /// proposal's.
  std::optional<Eigen::VectorXd> log_proposal;
};

/// ln of the mass that a mixture has inside the support of the priors: log_acceptance of a
/// proposal. In a box to the error of BoxProbability (1e-3 in six dimensions); with constraints
/// from 2^14 scrambled Sobol points per component, to about 1e-3.
double LogMassInSupport(std::span<const MixtureComponent> components, const JointPrior& priors);

/// Draws n samples (n x d). Deterministic in (options.seed, iteration, sample index), and row i
/// does not depend on n (except of a Latin hypercube, which is made for n). Iteration 0 without a
/// mixture: the quasi-random design through the prior's quantiles; points that violate a constraint
/// are passed over (of a Latin hypercube: each replaced by a draw from the prior). Otherwise each
/// sample has its own Philox stream; draws outside the support are redrawn, never clipped. Errors:
/// FAILED_PRECONDITION when a mixture has next to no mass (below 1e-3) inside the support.
absl::StatusOr<Eigen::MatrixXd> DrawSamples(const Proposal& proposal, const JointPrior& priors,
                                            const FilterOptions& options, int iteration, int n);

/// ln of the density of the proposal at each row of parameters, in the units of the parameters.
Eigen::VectorXd LogDensity(const Proposal& proposal, const JointPrior& priors,
                           const Eigen::MatrixXd& parameters);

struct ParameterSummary {
  double mean = 0, sd = 0, cov = 0;  ///< cov = sd / |mean|
  double q05 = 0, q50 = 0, q95 = 0;
  double prior_sd = 0;  ///< standard deviation of the prior, the scale of a mean near zero
  /// More than a tenth of the posterior lies in the outer 2 % of the prior's probability at one
  /// end that has a bound; InTail [parameter_summary.h] says it of an end that has none.
  bool at_bound = false;
};

/// The posterior along the readings: after load step s of the processing order. Rows: steps.
struct PosteriorPath {
  std::vector<int> experiment, load_step;  ///< S entries
  Eigen::MatrixXd mean, cov;               ///< S x d; cov NaN where the mean is zero
  Eigen::VectorXd ess;                     ///< S, in (0, 1]
  Eigen::VectorXd log_evidence;            ///< S, ln p(readings up to here)
};

struct Posterior {
  /// Normalised, over the samples of all iterations in order; -inf: diverged, outside or not used.
  Eigen::VectorXd log_weights;
  std::vector<ParameterSummary> parameters;
  Eigen::MatrixXd correlation;  ///< d x d
  double log_evidence = 0;      ///< ln p(data), proper Gaussian normalisation
  double log_evidence_se = 0;   ///< its standard error from the spread of weights (delta method)
  double ess = 0;               ///< effective number of samples (not a fraction)
  double pareto_k = 0;          ///< tail index of the weights; > 0.7: they cannot be trusted
  std::optional<double> sigma;  ///< kEssTarget: the sigma found
  PosteriorPath path;
  /// The same with the readings taken in from the last to the first [Cheng 2019, sec. 3.3.2], a
  /// presentation: its last row is the last row of `path`. Empty unless options.reversed_path.
  PosteriorPath reversed_path;
  /// kInferred: posterior quantiles of sqrt(f) per noise group (NoiseGroupsOf), groups x 3 (5, 50,
  /// 95 %): by how much the errors are larger than stated.
  Eigen::MatrixXd noise_scale;
  std::vector<std::optional<double>> frozen;  ///< of the last proposal: what all this is given
  /// Split-half agreement, d: difference of the means of two halves of the samples over the
  /// posterior sd, NaN for what is held. About 2 / sqrt(ess) where the weights are enough.
  Eigen::VectorXd split_half;
  /// kGiven: posterior predictive p-value of the misfit, sum_i w_i P(chi^2_T >= chi^2(y, x_i)):
  /// the share of data sets replicated from the posterior that fit no better [Gelman et al. 1996];
  /// of Fisher's law where few packings show the errors (chi_squared_law.h).
  std::optional<double> predictive_p;
  std::vector<std::string> warnings;  ///< whole sentences: diverged samples, tempering, ...
  /// Empty: the weights carry the posterior. Otherwise a sentence saying why not: fewer than 50
  /// effective samples or a Pareto index above 0.7; sd, quantiles and evidence above are then
  /// fiction and the posterior should be sampled on an emulator (emulator/emulated_posterior.h).
  /// Always empty with kEssTarget, whose weights are tempered until they suffice.
  std::string degeneracy;
};

/// ln (prior / proposal) of every sample of all iterations in order, the weight before any reading
/// counts. Proposal: the deterministic mixture sum_j N_j / N q_j over the iterations whose density
/// is known everywhere [Owen & Zhou 2000]; an iteration with log_proposal stands for itself. -inf
/// outside the prior's support.
Eigen::VectorXd LogImportance(const JointPrior& priors, std::span<const Iteration> iterations);

/// ln p(data | sample) of each row of predictions (N x T), with noise kGiven or kInferred; -inf
/// where a row is not finite. Errors: INVALID_ARGUMENT from ValidateData or for another width;
/// FAILED_PRECONDITION with kEssTarget, whose sigma exists only once the iteration is complete.
absl::StatusOr<Eigen::VectorXd> LogLikelihood(const DataSet& data, const FilterOptions& options,
                                              const Eigen::MatrixXd& predictions);

/// The largest LogLikelihood each row can still reach; NaN marks what has not been computed yet,
/// from some load step of an experiment on. Never below the final LogLikelihood (up to rounding): a
/// sample may be stopped on it. Errors as above.
absl::StatusOr<Eigen::VectorXd> LogLikelihoodBound(const DataSet& data,
                                                   const FilterOptions& options,
                                                   const Eigen::MatrixXd& predictions);

/// Posterior from all iterations together: weight ∝ prior x likelihood / deterministic mixture of
/// all proposals, so that the data count once. Where the last proposal holds parameters, it is the
/// posterior of the others given these, from the iterations that hold the same, the evidence ln
/// p(data | held values); sd and quantiles of a held parameter are NaN. kEssTarget uses the last
/// iteration alone, as the paper does; its log_evidence is that of the sigma found. Errors:
/// INVALID_ARGUMENT for priors, data, options or shapes that do not fit; FAILED_PRECONDITION when
/// no sample has a finite weight (all diverged or outside the prior). known: of the data's errors,
/// for predictive_p.
absl::StatusOr<Posterior> ComputePosterior(const JointPrior& priors, const DataSet& data,
                                           const FilterOptions& options,
                                           std::span<const Iteration> iterations,
                                           const KnownFrom& known = {});

/// The exponent in (0, 1] of the likelihood whose weights guide what comes next (proposal, early
/// stopping): the largest that leaves ess_target of one iteration's samples effective; 1 where the
/// plain weights do, and with kEssTarget. Errors as ComputePosterior.
absl::StatusOr<double> GuidingExponent(const JointPrior& priors, const DataSet& data,
                                       const FilterOptions& options,
                                       std::span<const Iteration> iterations);

/// Proposal of the next iteration: variational Dirichlet-process mixture fitted to the tempered
/// weights of all iterations (kEssTarget: the weights of the last), over the parameters that
/// `frozen` (empty, or d entries) leaves free, alone or joint with their states
/// (FilterOptions::mixture; of a joint mixture the exact marginal is proposed). Errors as
/// ComputePosterior, and INVALID_ARGUMENT when frozen leaves none free, lies outside the prior, or
/// the prior is correlated or constrained.
absl::StatusOr<Proposal> FitProposal(const JointPrior& priors, const DataSet& data,
                                     const FilterOptions& options,
                                     std::span<const Iteration> iterations,
                                     const std::vector<std::optional<double>>& frozen = {});

/// The proposal of the next iteration where weights carry next to nothing: a mixture fitted to
/// equally weighted draws (n x d, SI) of an emulated posterior, its covariances widened fourfold,
/// so that the next runs surround the posterior and the emulator interpolates there. Half of it is
/// fitted to `closest` (m x d, m may be 0), as wide as those lie. The defensive share of the prior
/// joins as always. `iterations`: how many there are so far, which chooses the random stream. Draws
/// have no states: FilterOptions::mixture has no effect. Errors: INVALID_ARGUMENT for shapes; those
/// of the mixture.
absl::StatusOr<Proposal> FitProposalToDraws(const JointPrior& priors, const FilterOptions& options,
                                            const Eigen::MatrixXd& draws, std::size_t iterations,
                                            const std::vector<std::optional<double>>& frozen = {},
                                            const Eigen::MatrixXd& closest = {});

/// True when every posterior mean moved by less than options.tolerance relative to itself [Table 1,
/// step 7], or, where it lies closer to zero than a tenth of the prior's sd, relative to that
/// tenth; or by less than a third of its posterior sd, a move nobody can act on (not with
/// kEssTarget, whose sd is no uncertainty). It says nothing about the weights: means can stand
/// still because one sample carries them all, so look at Posterior::degeneracy too.
bool MeansConverged(const Posterior& before, const Posterior& now, const FilterOptions& options);
/// The same of each parameter, d entries; none where the two have not the same parameters.
std::vector<char> ConvergedMeans(const Posterior& before, const Posterior& now,
                                 const FilterOptions& options);

/// State of the running iteration from the readings that have arrived, for the live view: only load
/// steps that every undiverged sample has reached count, per experiment; where there is none, the
/// samples that have ended, with all of theirs. Weights are likelihoods alone. N x T predictions,
/// NaN where not yet reached; diverged: N flags.
struct OnlineView {
  int readings = 0;  ///< readings that count
  double ess = 0;    ///< effective number of samples
  int best = -1;     ///< sample with the largest likelihood
  /// Root mean square of the best sample's residuals over sd (kEssTarget: over sqrt(w_j) |y|).
  double best_rms = 0;
};
OnlineView ViewOnline(const DataSet& data, const FilterOptions& options,
                      const Eigen::MatrixXd& predictions, std::span<const char> diverged);

}  // namespace calib::inference
