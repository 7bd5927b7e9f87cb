#pragma once
// Iterative Bayesian filter [Cheng et al. 2019, CMAME 350] as pure functions of what has been
// computed so far; sequential quasi-Monte Carlo [Cheng et al. 2018, Granular Matter 20:11] is its
// first iteration alone. It departs from the paper where each comment says so: weights are over a
// mixture of all proposals, the posterior is not tempered, proposals are.

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

/// Design of the first iteration's samples. kSymmetricLatinHypercube: of 1000 the one whose closest
/// points lie farthest apart [Samuelsson 2023, sec. 3.2].
enum class Design { kHalton, kSobol, kLatinHypercube, kSymmetricLatinHypercube };

/// What the mixture of the next proposal is fitted to: the parameters, or the parameters joint with
/// the predictions of their runs (JoinStates in joint_states.h) [Cheng 2019, sec. 3.2]. The
/// proposal is the mixture's density of the parameters either way.
enum class MixtureOver { kParameters, kParametersAndStates };

/// Options of the filter. Defaults without a source are chosen: with them weights stay bounded on
/// the test problems of inference_verification_test.
struct FilterOptions {
  NoiseMode noise = NoiseMode::kGiven;
  /// (0, 1): effective sample size, as a share of the samples of one iteration, of the tempered
  /// weights that shape the next proposal (and of kEssTarget itself) [Cheng 2019, Table 1, step 4].
  double ess_target = 0.2;
  /// > 0: relative change of the means that ends it [Cheng 2019, Table 1, step 7].
  double tolerance = 1e-2;
  double defensive_share = 0.1;  ///< share of the prior in every later proposal, [0, 1)
  int max_components = 10;       ///< >= 1: truncation of the mixture's Dirichlet process
  double concentration = 0.01;   ///< > 0: alpha of the Dirichlet process [Cheng 2019, sec. 3.5]
  MixtureOver mixture = MixtureOver::kParameters;
  Design design = Design::kHalton;  ///< of the first iteration [Cheng 2019: Halton]
  bool reversed_path = false;       ///< also give the path with the readings in reversed order
  std::uint64_t seed = 0;
  /// INVALID_ARGUMENT naming the field, what was found and what is allowed.
  absl::Status Validate() const;
};

/// Density from which the samples of one iteration are drawn: the prior alone (no components:
/// iteration 0), or (1 - defensive_share) * mixture truncated to the prior's support +
/// defensive_share * prior.
struct Proposal {
  using Component = MixtureComponent;
  std::vector<Component> components;  ///< in standardised coordinates (Prior::ToStandard)
  double defensive_share = 0;         ///< of the prior, [0, 1]
  double log_acceptance = 0;          ///< ln of the mixture's mass inside the prior's support
  /// Empty, or d entries: parameters held at a value, in their own unit [Cheng 2019, sec. 6.2]. The
  /// mixture is then one of the others, in their order. Independent, unconstrained priors only.
  std::vector<std::optional<double>> frozen = {};
};

/// Whether both proposals hold the same parameters at the same values.
bool SameFrozen(const Proposal& a, const Proposal& b);

/// One finished iteration: N samples of d parameters, predictions of the T readings.
struct Iteration {
  Proposal proposal;
  Eigen::MatrixXd parameters;  ///< N x d, in the parameters' units
  /// N x T, in the readings' units; a row with any NaN is a diverged sample: weight zero.
  Eigen::MatrixXd predictions;
  /// N: ln of the density from which each sample was really drawn, for runs made elsewhere; it
  /// replaces the proposal's. +infinity: drawn from no density; its weight is zero.
  std::optional<Eigen::VectorXd> log_proposal;
  /// N x T or empty: runs stopped early as far as they came, NaN beyond and in the rows of others.
  /// To the weights they are diverged; an emulator learns from them (emulator/stopped_runs.h).
  Eigen::MatrixXd stopped = {};
  /// N or empty: not 0 where nothing is known of a sample, whatever `predictions` holds. It has no
  /// weight, and the evidence is a mean without it.
  std::vector<char> aside = {};
};

/// ln of the mass that a mixture, in standardised coordinates, has inside the support of the
/// priors: Proposal::log_acceptance. In a box to the error of BoxProbability (1e-3 in six
/// dimensions); with constraints from 2^14 scrambled Sobol points per component, to about 1e-3.
double LogMassInSupport(std::span<const MixtureComponent> components, const JointPrior& priors);

/// Draws n samples from a proposal, n x d, in the parameters' units. Deterministic in
/// (options.seed, iteration, sample index). Iteration 0 without a mixture: the design through the
/// prior's quantiles, its rows in an order by chance within blocks of 64 so that what goes by
/// sample numbers does not go by a parameter; points that violate a constraint are passed over (of
/// a Latin hypercube: each replaced by a draw from the prior); whole blocks do not depend on n, but
/// for a Latin hypercube, which is made for n. Otherwise each sample has its own Philox stream and
/// does not depend on n; draws outside the support are redrawn, never clipped. Errors:
/// INVALID_ARGUMENT for no sample or no parameter; FAILED_PRECONDITION when a mixture has next to
/// no mass (below 1e-3) inside the support.
absl::StatusOr<Eigen::MatrixXd> DrawSamples(const Proposal& proposal, const JointPrior& priors,
                                            const FilterOptions& options, int iteration, int n);

/// ln of the density of the proposal at each row of parameters (n x d), n entries, per unit of the
/// parameters.
Eigen::VectorXd LogDensity(const Proposal& proposal, const JointPrior& priors,
                           const Eigen::MatrixXd& parameters);

/// The posterior of one parameter, in its unit.
struct ParameterSummary {
  double mean = 0, sd = 0, cov = 0;  ///< cov = sd / |mean|, the coefficient of variation
  double q05 = 0, q50 = 0, q95 = 0;  ///< 5, 50 and 95 % quantiles
  double prior_sd = 0;  ///< standard deviation of the prior, the scale of a mean near zero
  /// More than a tenth of the posterior lies in the outer 2 % of the prior's probability at one
  /// end that has a bound; InTail (parameter_summary.h) says it of an end that has none.
  bool at_bound = false;
};

/// The posterior of d parameters along the readings: as it stands after each of S load steps of the
/// processing order.
struct PosteriorPath {
  std::vector<int> experiment, load_step;  ///< S: the last ones taken in
  Eigen::MatrixXd mean, cov;     ///< S x d, cov = sd / |mean|; cov NaN where the mean is zero
  Eigen::VectorXd ess;           ///< S, effective share of the samples, (0, 1]
  Eigen::VectorXd log_evidence;  ///< S, ln p(readings up to here)
};

/// What the weighted samples of all iterations say of d parameters.
struct Posterior {
  /// N: normalised, over the samples of all iterations in order; -infinity: diverged, outside the
  /// prior or not used.
  Eigen::VectorXd log_weights;
  std::vector<ParameterSummary> parameters;  ///< d
  Eigen::MatrixXd correlation;               ///< d x d
  double log_evidence = 0;                   ///< ln p(data), proper Gaussian normalisation
  /// Error of log_evidence: standard error (ImportanceEvidence) and what seems lost
  /// (FindLostModes).
  double log_evidence_se = 0;
  double ess = 0;               ///< effective number of samples, [1, N]
  double pareto_k = 0;          ///< ParetoTailIndex of the weights; > 0.7: they cannot be trusted
  std::optional<double> sigma;  ///< kEssTarget alone: the sigma found
  PosteriorPath path;           ///< along the readings in processing order
  /// Along the readings from the last to the first, a presentation: its last row is the last row of
  /// `path`. Empty unless options.reversed_path.                     [Cheng 2019, sec. 3.3.2]
  PosteriorPath reversed_path;
  /// kInferred alone: posterior quantiles (5, 50, 95 %) of sqrt(f) of each noise group
  /// (NoiseGroupsOf), groups x 3: by how much the errors are larger than stated.
  Eigen::MatrixXd noise_scale;
  /// kModelError alone: what the model is off by, for each of the data's model errors.
  std::vector<ModelErrorSummary> model_errors;
  /// Proposal::frozen of the last iteration: the posterior is that of the others given these
  /// values.
  std::vector<std::optional<double>> frozen;
  /// d: difference of the means of two halves of the samples (Halves in shuffle.h) over the
  /// posterior sd, NaN for what is held. About 2 / sqrt(ess) where the weights are enough.
  Eigen::VectorXd split_half;
  /// kGiven alone: posterior predictive p-value of the misfit, sum_i w_i P(chi^2_T >= chi^2(y,
  /// x_i)), the share of data sets replicated from the posterior that fit no better; by UpperTail
  /// (chi_squared_law.h) where few packings show the errors.                 [Gelman et al. 1996]
  std::optional<double> predictive_p;
  std::vector<std::string> warnings;  ///< whole sentences: diverged samples, tempering, ...
  /// Empty: the weights carry the posterior. Otherwise a sentence saying why not: fewer than 50
  /// effective samples, a Pareto index above 0.7, or a mode that iterations have seen and left
  /// (evidence/lost_modes.h); sd, quantiles and evidence are then fiction and the posterior should
  /// be sampled on an emulator (emulator/emulated_posterior.h). With kEssTarget, whose weights are
  /// tempered until they suffice: fewer than two effective ones.
  std::string degeneracy;
};

/// ln (prior / proposal) of every sample of all iterations in order, the weight before any reading
/// counts; -infinity outside the prior's support. Proposal: the deterministic mixture
/// sum_j N_j / N q_j over the iterations whose density is known everywhere [Owen & Zhou 2000]; an
/// iteration with log_proposal stands for itself.
Eigen::VectorXd LogImportance(const JointPrior& priors, std::span<const Iteration> iterations);

/// ln p(data | sample) of each row of predictions (N x T), N entries; -infinity where a row is not
/// finite. Errors: INVALID_ARGUMENT from ValidateData or for another width; FAILED_PRECONDITION
/// with kEssTarget, whose sigma exists only once the iteration is complete.
absl::StatusOr<Eigen::VectorXd> LogLikelihood(const DataSet& data, const FilterOptions& options,
                                              const Eigen::MatrixXd& predictions);

/// The largest LogLikelihood that each row of predictions (N x T) can still reach, N entries; NaN
/// marks what has not been computed yet, from some load step of an experiment on. Never below the
/// final LogLikelihood (up to rounding): a sample may be stopped on it. Errors: those of
/// LogLikelihood.
absl::StatusOr<Eigen::VectorXd> LogLikelihoodBound(const DataSet& data,
                                                   const FilterOptions& options,
                                                   const Eigen::MatrixXd& predictions);

/// Posterior from all iterations together: weight ∝ prior x likelihood / deterministic mixture of
/// all proposals, so that the data count once. Where the last proposal holds parameters, it is the
/// posterior of the others given these, from the iterations that hold the same, the evidence ln
/// p(data | held values); sd and quantiles of a held parameter are NaN. kEssTarget uses the last
/// iteration alone, as the paper does; its log_evidence is that of the sigma found. Errors:
/// INVALID_ARGUMENT for priors, data, options or shapes that do not fit; FAILED_PRECONDITION when
/// no iteration is finished or no sample has a finite weight (all diverged or outside the prior).
/// known: how well the data's errors are known, for Posterior::predictive_p.
absl::StatusOr<Posterior> ComputePosterior(const JointPrior& priors, const DataSet& data,
                                           const FilterOptions& options,
                                           std::span<const Iteration> iterations,
                                           const KnownFrom& known = {});

/// The exponent in (0, 1] of the likelihood whose weights guide what comes next (proposal, early
/// stopping): the largest that leaves ess_target of one iteration's samples effective; 1 where the
/// plain weights do, and with kEssTarget. Errors: those of ComputePosterior.
absl::StatusOr<double> GuidingExponent(const JointPrior& priors, const DataSet& data,
                                       const FilterOptions& options,
                                       std::span<const Iteration> iterations);

/// Proposal of the next iteration: variational Dirichlet-process mixture fitted to the tempered
/// weights of all iterations (kEssTarget: the weights of the last), over the parameters that
/// `frozen` (empty, or d entries) leaves free, alone or joint with their states
/// (FilterOptions::mixture; of a joint mixture the exact marginal is proposed). Errors: those of
/// ComputePosterior; INVALID_ARGUMENT when frozen leaves none free, lies outside the prior, or the
/// prior is correlated or constrained; FAILED_PRECONDITION with too few samples for a mixture.
absl::StatusOr<Proposal> FitProposal(const JointPrior& priors, const DataSet& data,
                                     const FilterOptions& options,
                                     std::span<const Iteration> iterations,
                                     const std::vector<std::optional<double>>& frozen = {});

/// The proposal of the next iteration where weights carry next to nothing: a mixture fitted to
/// equally weighted draws (n x d, in the parameters' units) of an emulated posterior, its
/// covariances widened fourfold,
/// so that the next runs surround the posterior and the emulator interpolates there. Half of it is
/// fitted to `closest` (m x d, m may be 0), as wide as those lie. The defensive share of the prior
/// joins as always. `iterations`: how many there are so far, which chooses the random stream. Draws
/// have no states: FilterOptions::mixture has no effect. Errors: INVALID_ARGUMENT for shapes or
/// `frozen`, as FitProposal; those of FitDirichletMixture.
absl::StatusOr<Proposal> FitProposalToDraws(const JointPrior& priors, const FilterOptions& options,
                                            const Eigen::MatrixXd& draws, std::size_t iterations,
                                            const std::vector<std::optional<double>>& frozen = {},
                                            const Eigen::MatrixXd& closest = {});

/// True when every posterior mean moved by less than options.tolerance relative to itself
/// [Cheng 2019, Table 1, step 7], or, where it lies closer to zero than a tenth of the prior's sd,
/// relative to that tenth; or by less than a third of its posterior sd, a move nobody can act on
/// (not with kEssTarget, whose sd is no uncertainty). It says nothing about the weights: means can
/// stand still because one sample carries them all, so look at Posterior::degeneracy too.
bool MeansConverged(const Posterior& before, const Posterior& now, const FilterOptions& options);
/// Whether the mean of each parameter has converged as MeansConverged says, d entries; none where
/// the two posteriors have not the same parameters.
std::vector<char> ConvergedMeans(const Posterior& before, const Posterior& now,
                                 const FilterOptions& options);

/// State of a running iteration from the readings that have arrived.
struct OnlineView {
  int readings = 0;  ///< readings that count
  double ess = 0;    ///< effective number of samples
  int best = -1;     ///< sample with the largest likelihood
  /// Root mean square of the best sample's residuals over sd (kEssTarget: over sqrt(w_j) |y|).
  double best_rms = 0;
};

/// Summarises a running iteration for the live view: only load steps that every undiverged sample
/// has reached count, per experiment; where there is none, the samples that have ended, with all of
/// their steps. Weights are likelihoods alone.
/// in: predictions N x T, NaN where not yet reached; diverged, N flags
OnlineView ViewOnline(const DataSet& data, const FilterOptions& options,
                      const Eigen::MatrixXd& predictions, std::span<const char> diverged);

}  // namespace calib::inference
