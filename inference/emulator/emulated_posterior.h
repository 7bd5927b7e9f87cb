#pragma once
// The posterior from few runs of an expensive model: sampled on an emulator of the runs' histories,
// whose error is part of the likelihood. For campaigns whose weights are not enough
// (Posterior::degeneracy in filter/iterative_filter.h): with honest noise a posterior is tiny
// against the prior, and a hundred weighted runs hold one effective sample.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/emulator/training_set.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"
#include "inference/scatter/chi_squared_law.h"
#include "inference/scatter/refit_spread.h"

namespace calib::inference {

/// Some of the readings, whose misfit is judged by itself.
struct JudgedReadings {
  std::vector<int> readings;  ///< ascending indices
  KnownFrom known = {};       ///< how well their errors about a run are known
};

/// Options of EmulatedPosterior.
struct EmulatorOptions {
  /// All but kEssTarget, which is a tempering chosen from the weights of the runs themselves,
  /// there is nothing in it to emulate: INVALID_ARGUMENT.
  NoiseMode noise = NoiseMode::kGiven;
  TrainingOptions training = {};
  int draws = 2000;        ///< from the posterior, [100, 1e5]; also the population of the sampler
  double target_cv = 0.7;  ///< TmcmcOptions::target_cv of the sampler, (0, 2]
  int steps = 5;           ///< TmcmcOptions::steps of the sampler, >= 1
  /// Largest EmulatedResult::cross_validated_error of an adequate emulator [noise sd], > 0. Chosen
  /// with the next two: beyond them intervals are fiction (measured by EmulatorCoverage of
  /// inference_emulator_verification_test: 26 of 36 nine-tenths intervals hold the truth).
  double max_error = 3;
  /// Largest part of that error that the likelihood's covariance does not contain,
  /// sqrt(error^2 - scatter_share scatter^2), of an adequate emulator [noise sd], > 0.
  double max_uncovered = 2;
  /// Largest EmulatedResult::calibration of an adequate emulator, > 1.
  double max_calibration = 2;
  /// Largest EmulatedResult::emulator_sd of an adequate emulator [noise sd], > 0. Chosen: campaigns
  /// that fit have 0.17 to 0.31, one that fits nowhere 2.9 (deploy/bench/hidden-effects).
  double max_unknown = 1;
  /// The posterior is widened until it covers refits of these (SpreadOfRefits), with kGiven.
  std::optional<Replicates> replicates = {};
  /// How well the errors of the readings about a run are known, for EmulatedResult::predictive_p.
  KnownFrom known = {};
  std::vector<JudgedReadings> stages = {};  ///< for EmulatedResult::stage_p
  /// Draws carried along the readings for EmulatedResult::path, [100, 1e5]; 0: no path.
  int path_draws = 0;
  bool reversed_path = false;  ///< also EmulatedResult::reversed_path, where there is a path
  std::uint64_t seed = 0;
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// A posterior of d parameters sampled on an emulator, what the emulator is worth, and the verdict.
struct EmulatedResult {
  Eigen::MatrixXd draws;  ///< draws x d, equally weighted, in the parameters' units
  /// For each draw the root mean square over the readings of its mean history's distance from them,
  /// in their sd.
  Eigen::VectorXd misfit;
  std::vector<ParameterSummary> parameters;  ///< d
  Eigen::MatrixXd correlation;               ///< d x d
  double log_evidence = 0;                   ///< ln p(data), emulator error included
  double log_evidence_se = 0;  ///< of the sampling alone; SplitHalf has the emulator's
  /// kInferred alone: posterior median of the variance factor f of each noise group
  /// (NoiseGroupsOf).
  Eigen::VectorXd variance_factors;
  /// kInferred alone: posterior quantiles (5, 50, 95 %) of sqrt(f) of each noise group, groups x 3.
  Eigen::MatrixXd noise_scale;
  /// kModelError alone: what the model is off by, for each of the data's model errors.
  std::vector<ModelErrorSummary> model_errors;

  /// History of the model over the posterior, T entries, in units of the readings: mean and
  /// quantiles over parameters and over what the emulator does not know of the mean history.
  /// Without a run's scatter and the readings' noise.
  Eigen::VectorXd predictive_mean, predictive_q05, predictive_q50, predictive_q95;
  Eigen::VectorXd predictive_q025, predictive_q25, predictive_q75, predictive_q975;

  /// Root mean square error of a run predicted from the others, over the relevant runs and all
  /// readings, in units of the noise sd (of the inferred one with kInferred and kModelError).
  double cross_validated_error = 0;
  /// T: root mean square error of each reading of a run predicted from the others, in units of its
  /// noise sd.
  Eigen::VectorXd reading_error;
  double scatter = 0;  ///< part of cross_validated_error put down to the scatter of single runs
  /// The emulator's own sd of the mean history, root mean square over posterior and readings, in
  /// units of the noise sd.
  double emulator_sd = 0;
  double calibration = 0;  ///< CrossValidation::calibration (state_emulator.h)
  double widened = 1;      ///< largest factor on a parameter's sd by refits of the replicates

  /// kGiven alone: posterior predictive p-value of the misfit as Posterior::predictive_p, the mean
  /// over the posterior (before refits widen it) of UpperTail, the emulator's error and the shared
  /// scatter in the covariance.                                              [Gelman et al. 1996]
  std::optional<double> predictive_p;
  std::vector<double> stage_p;  ///< kGiven alone: predictive_p of each of options.stages
  /// d: SplitHalf::difference of SplitHalfOfEmulator (split_half.h); empty: not asked for.
  Eigen::VectorXd split_half;

  /// Scatter of a single run about the mean history, in units of the readings: covariance
  /// scatter_factor scatter_factor^T + diag(scatter_white).
  Eigen::MatrixXd scatter_factor;  ///< T x q
  Eigen::VectorXd scatter_white;   ///< T

  /// The posterior along the readings, forward and from the last to the first (emulated_path.h);
  /// empty: not asked for, not adequate, or the emulator knows too little of the prior to begin.
  PosteriorPath path, reversed_path;

  int runs = 0;        ///< that the emulator learned from
  int components = 0;  ///< of the emulator
  bool local = false;  ///< TrainedEmulator::local (training_set.h)
  /// False: the emulator is not good enough for an interval; report no posterior (converged:
  /// false). `reason` then says why and what helps, in a sentence. Where it knows the model's
  /// history nowhere in the prior, nothing has been sampled: draws, parameters, correlation and the
  /// predictive histories are empty, the evidence is NaN.
  bool adequate = false;
  std::string reason;
};

/// Emulates the runs of all iterations (diverged ones left out, stopped ones completed as
/// CompletedRuns says; how they were proposed does not matter, which is what makes an emulated
/// posterior independent of weights) and samples prior x likelihood by TMCMC (tmcmc.h).
/// Deterministic in options.seed. About a second or two at 400 runs, 5 parameters and 300 readings.
/// With kInferred a variance factor f multiplies the noise of each noise group, inverse gamma prior
/// (VarianceFactorPrior), sampled along as f = 1 / z^2, z half normal, where shape and rate are
/// 1/2, else as its quantile at Phi(z), z normal. Parameters that the last iteration holds
/// (Proposal::frozen) are held: the runs of all iterations teach the emulator, only the others are
/// sampled. Errors: INVALID_ARGUMENT for options, priors, data or shapes; FAILED_PRECONDITION with
/// too few undiverged runs; CANCELLED once `stop` is requested.
absl::StatusOr<EmulatedResult> EmulatedPosterior(const JointPrior& priors, const DataSet& data,
                                                 const EmulatorOptions& options,
                                                 std::span<const Iteration> iterations,
                                                 const std::stop_token& stop = {});

}  // namespace calib::inference
