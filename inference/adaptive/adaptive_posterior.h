#pragma once
// The posterior on an emulator of the runs so far, with the emulator's error in it and beside it.

#include <Eigen/Core>
#include <cstdint>

#include "inference/adaptive/adaptive_runs.h"
#include "inference/adaptive/known_region.h"
#include "inference/adaptive/response_emulator.h"

namespace calib::inference {

/// How AdaptivePosterior is sampled. Chosen: means are known to 0.03 sd, a third of what they may
/// move by at the end.
struct AdaptiveSamplingOptions {
  int points = 1000;        ///< of each proposal, CubeSamplingOptions::points
  double effective = 1000;  ///< CubeSamplingOptions::effective
  int realisations = 64;    ///< of the emulator, >= 2
  int at = 200;             ///< points of the posterior that these are drawn at, >= 20
  std::uint64_t seed = 0;
  std::uint64_t number = 0;  ///< names the decision among those of one seed
};

/// Weighted draws of a posterior p(x | readings) ~ p(x) E[L(x)] P(runs complete at x), L the
/// likelihood by SpecimenLogDensity and E the mean over what the emulator does not know.
struct AdaptivePosterior {
  Eigen::MatrixXd draws;          ///< n x d, in the prior's units
  Eigen::MatrixXd standard;       ///< n x d, standardised
  Eigen::VectorXd log_weights;    ///< n, normalised
  Eigen::VectorXd mean, sd;       ///< d, standardised; the emulator's error is in the sd
  Eigen::VectorXd mean_error;     ///< d: standard error of the mean by the emulator's
  Eigen::VectorXd log_sd_error;   ///< d: of ln sd
  double log_evidence = 0;        ///< of the measured coordinates, in their units
  double log_evidence_error = 0;  ///< by the emulator and by sampling
  double effective = 0;           ///< effective draws
  double at_edge = 0;             ///< share of the posterior where runs fail as often as not
  /// n: ln of p(x) sqrt(E[L^2]) over the proposal, normalised: the weights by which the same draws
  /// cover where the density may be large. ln E[L] and 1/2 ln E[L^2] at each of them.
  Eigen::VectorXd log_cover, log_mean, log_root_square;
};

/// Samples the prior times sqrt(E[L^2]) (SampleCube), which is wide where the emulator is not sure,
/// and weighs for the posterior. Errors by realisations of the emulator and of the scatter, drawn
/// jointly at `at` points of the posterior, of each of which they make other weights. L is
/// Student's (errors of the emulator), E[L^2] that of the normal law,
///   E[L^2] = prod_k (4 pi V_k)^(-1/2) N(z_k; m_k, V_k / 2 + S_k)
///                       [Sinsbeck & Nowak, SIAM/ASA J. Uncertain. Quantif. 5 (2017) 640, sec. 3]
/// Deterministic in options.seed and number. No draws where no point has a density.
AdaptivePosterior SamplePosterior(const AdaptiveProblem& problem, const ResponseEmulator& emulator,
                                  const KnownRegion& region,
                                  const AdaptiveSamplingOptions& options);

/// Rows of n normalised log weights that stand for all, `count` of them, by systematic resampling
/// from its middle; ascending, a row as often as it weighs.
std::vector<Eigen::Index> Resampled(const Eigen::VectorXd& log_weights, Eigen::Index count);

}  // namespace calib::inference
