#pragma once
// Which runs an adaptive calibration makes next. Pure functions.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "inference/adaptive/adaptive_posterior.h"
#include "inference/adaptive/adaptive_runs.h"
#include "inference/adaptive/known_region.h"
#include "inference/adaptive/response_emulator.h"

namespace calib::inference {

/// Runs to be made.
struct AdaptiveBatch {
  Eigen::MatrixXd parameters{};  ///< n x d, in the prior's units
  std::vector<int> packing{};    ///< n
  /// Of NextBatch: part of the integral variance that is expected to go with it, [0, 1].
  double expected_gain = 0;
};

/// What a batch is made of.
struct BatchOptions {
  int runs = 6;     ///< of the batch, >= 1
  int explore = 1;  ///< of these, for what the emulator may not know, [0, runs]
  std::uint64_t seed = 0;
  std::uint64_t number = 0;  ///< names the batch among those of one seed
};

/// `runs` points that fill the prior, a scrambled Sobol sequence, and `repeats` <= runs of the
/// first of them again on another packing (with one packing: with parameters moved by a millionth),
/// which tell scatter from what an emulator misses. Packings are balanced, their order by chance in
/// blocks. given: runs that are made beside them; each stands for the point nearest to it, which is
/// left out, if that is no farther from it than from the next point. Deterministic.
AdaptiveBatch FirstRuns(const AdaptiveProblem& problem, int runs, int repeats, std::uint64_t seed,
                        const AdaptiveBatch& given = {});

/// The batch, one run after the other, after which the integral over the prior's cube of the
/// variance of the likelihood is expected to be least,
///   EIV = int E[L^2] - E_D[E[L | D]^2],   S' = S - R the variance that the batch leaves,
///   E_D[E[L | D]^2] = prod_k (4 pi (V + S'))^(-1/2) N(z; m, (V + S') / 2 + R),
/// V the variance of a measurement about the mean over packings and R = c^2 / (s + T) for one run,
/// c its covariance with the point, s its own variance, T that of a run on a packing of its own.
///   [Järvenpää, Gutmann, Vehtari & Marttinen, Bayesian Anal. 16 (2021) 147, Eqs. 15-17;
///    for emulated outputs Sinsbeck & Nowak, SIAM/ASA J. Uncertain. Quantif. 5 (2017) 640]
/// Pending runs count as made: what they will tell is unknown, not how much.
/// Candidates are draws where the density may be large, some of them as far again or thrice as far
/// from their mean. The exploring runs lie, of points all over the prior whose readings would not
/// be excluded were the emulator off by three of its sd, farthest from all runs. Packings that hold
/// the fewest runs come first. Deterministic in seed and number.
/// emulator, posterior: of the runs that have ended
AdaptiveBatch NextBatch(const AdaptiveProblem& problem, const AdaptiveRuns& runs,
                        const ResponseEmulator& emulator, const KnownRegion& region,
                        const AdaptivePosterior& posterior, const BatchOptions& options);

/// `runs` draws of the posterior, evenly through its weights, on the packings with the fewest runs.
AdaptiveBatch VerifyingRuns(const AdaptiveProblem& problem, const AdaptiveRuns& runs,
                            const AdaptivePosterior& posterior, int number);

}  // namespace calib::inference
