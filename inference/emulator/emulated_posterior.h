#pragma once
// The posterior from few runs of an expensive model: sampled on an emulator of the runs' histories,
// whose error is part of the likelihood. For campaigns whose weights are not enough
// [filter/iterative_filter.h, ess and pareto_k]: with honest noise a posterior is tiny against the
// prior, and a hundred weighted runs hold one effective sample.

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
  KnownFrom known = {};       ///< of their errors about a run
};

struct EmulatorOptions {
  /// kGiven or kInferred. kEssTarget is a tempering chosen from the weights of the runs themselves,
  /// there is nothing in it to emulate: INVALID_ARGUMENT.
  NoiseMode noise = NoiseMode::kGiven;
  TrainingOptions training = {};
  int draws = 2000;        ///< from the posterior, [100, 1e5]; also the population of the sampler
  double target_cv = 0.7;  ///< of the sampler's weights per stage, see TmcmcOptions
  int steps = 5;           ///< Metropolis steps per stage, see TmcmcOptions
  /// Limits of an adequate emulator; README.md of this folder has the reasons. Of
  /// cross_validated_error; of the part of it that the likelihood's covariance does not contain,
  /// sqrt(error^2 - scatter_share scatter^2); of calibration; of emulator_sd.
  double max_error = 3;        ///< > 0
  double max_uncovered = 2;    ///< > 0
  double max_calibration = 2;  ///< > 1
  double max_unknown = 1;      ///< > 0
  /// The posterior is widened until it covers refits of these, where there are any (kGiven).
  std::optional<Replicates> replicates = {};
  /// Of the errors of a reading about a run, for predictive_p.
  KnownFrom known = {};
  std::vector<JudgedReadings> stages = {};  ///< for stage_p
  /// Draws carried along the readings for EmulatedResult::path, 0: no path; and for reversed_path.
  int path_draws = 0;  ///< 0 or [100, 1e5]
  bool reversed_path = false;
  std::uint64_t seed = 0;
  absl::Status Validate() const;
};

struct EmulatedResult {
  Eigen::MatrixXd draws;  ///< equally weighted, draws x d
  /// Of each draw: root mean square of its mean history's distance from the readings, in their sd.
  Eigen::VectorXd misfit;
  std::vector<ParameterSummary> parameters;
  Eigen::MatrixXd correlation;       ///< d x d
  double log_evidence = 0;           ///< ln p(data), emulator error included
  double log_evidence_se = 0;        ///< of the sampling alone; SplitHalf has the emulator's
  Eigen::VectorXd variance_factors;  ///< kInferred: posterior median of f per noise group
                                     ///< (NoiseGroupsOf)
  Eigen::MatrixXd noise_scale;       ///< kInferred: quantiles of sqrt(f), groups x 3 (5, 50, 95 %)

  /// History of the model over the posterior, T entries, in units of the readings: mean and
  /// quantiles over parameters and over what the emulator does not know of the mean history.
  /// Without a run's scatter and the readings' noise.
  Eigen::VectorXd predictive_mean, predictive_q05, predictive_q50, predictive_q95;

  /// Root mean square error of a run predicted from the others, over the relevant runs and all
  /// readings, in units of the noise sd (of the inferred one with kInferred); the same per reading,
  /// T; the part put down to scatter; and the emulator's own sd of the mean history, root mean
  /// square over posterior and readings.
  double cross_validated_error = 0;
  Eigen::VectorXd reading_error;
  double scatter = 0;
  double emulator_sd = 0;
  double calibration = 0;  ///< see CrossValidation
  /// Factor by which refits of the replicates widened the posterior, the largest of a parameter's
  /// sd.
  double widened = 1;

  /// kGiven: posterior predictive p-value of the misfit, the mean over the posterior (before refits
  /// widen it) of P(chi^2_T >= chi^2(y, x)), or of Fisher's law where few packings show the scatter,
  /// the emulator's error and the shared scatter in the covariance [Gelman et al. 1996]; see
  /// Posterior::predictive_p.
  std::optional<double> predictive_p;
  std::vector<double> stage_p;  ///< kGiven: the same of each of options.stages alone
  /// As Posterior::split_half, of SplitHalfOfEmulator (split_half.h); empty: not asked for.
  Eigen::VectorXd split_half;

  /// Scatter of a single run about the mean history, in units of the readings: covariance
  /// scatter_factor scatter_factor^T + diag(scatter_white).
  Eigen::MatrixXd scatter_factor;  ///< T x q
  Eigen::VectorXd scatter_white;   ///< T

  /// The posterior along the readings, forward and from the last to the first (emulated_path.h);
  /// empty: not asked for, not adequate, or the emulator knows too little of the prior to begin.
  PosteriorPath path, reversed_path;

  int runs = 0;  ///< the emulator learned from
  int components = 0;
  bool local = false;  ///< see TrainedEmulator
  /// False: the emulator is not good enough for an interval; report no posterior (converged:
  /// false). `reason` then says why and what helps, in a sentence. Where it knows the model's
  /// history nowhere in the prior, nothing has been sampled: draws, parameters, correlation and the
  /// predictive histories are empty, the evidence is NaN.
  bool adequate = false;
  std::string reason;
};

/// Emulates the runs of all iterations (rows with NaN left out; how they were proposed does not
/// matter, which is what makes an emulated posterior independent of weights) and samples prior x
/// likelihood by TMCMC. Deterministic in options.seed. About a second or two at 400 runs, 5
/// parameters and 300 readings. With kInferred a variance factor f multiplies the noise of each
/// noise group, inverse gamma prior (VarianceFactorPrior), sampled along as f = 1 / z^2, z half
/// normal, where shape and rate are 1/2, else as its quantile at Phi(z), z normal. Parameters that
/// the last iteration holds (Proposal::frozen) are held: the runs of all iterations teach the
/// emulator, only the others are sampled. Errors: INVALID_ARGUMENT for options, priors, data or
/// shapes; FAILED_PRECONDITION with too few undiverged runs; CANCELLED.
absl::StatusOr<EmulatedResult> EmulatedPosterior(const JointPrior& priors, const DataSet& data,
                                                 const EmulatorOptions& options,
                                                 std::span<const Iteration> iterations,
                                                 const std::stop_token& stop = {});

}  // namespace calib::inference
