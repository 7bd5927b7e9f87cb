#pragma once
// An adaptive calibration: runs so far in, posterior and next runs out, or why it ends.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/adaptive/adaptive_posterior.h"
#include "inference/adaptive/adaptive_runs.h"
#include "inference/adaptive/next_batch.h"

namespace calib::inference {

/// Options of an adaptive calibration.
struct AdaptiveOptions {
  int max_runs = 150;  ///< of all batches together, those given aside, >= 1
  int batch = 6;       ///< runs of a batch, >= 1
  int explore = 1;     ///< BatchOptions::explore
  int first_per_parameter =
      10;                    ///< runs of the first batch [Loeppky et al. 2009, Technometrics 51]
  int repeats = 4;           ///< of these, see FirstRuns
  int verify = 6;            ///< fresh runs of the posterior that are predicted at the end, >= 1
  double mean_moves = 0.1;   ///< a mean has settled that moves by less, in sd, > 0
  double width_moves = 0.1;  ///< a width has settled that changes by less, relative, > 0
  double mean_error =
      0.15;  ///< a mean is known that the emulator leaves uncertain by less, in sd, > 0
  AdaptiveSamplingOptions sampling = {};  ///< `seed` and `number` are set by DecideAdaptive
  std::uint64_t seed = 0;
  std::vector<std::string> names = {};  ///< d, of the parameters in sentences; or none
  AdaptiveBatch given = {};  ///< runs of the first batch that max_runs does not count: FirstRuns
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// What a batch is for, or how the calibration has ended.
enum class AdaptiveStage {
  kFirst,         ///< runs fill the prior
  kSearching,     ///< runs go where the posterior is least certain
  kVerifying,     ///< fresh runs of the posterior, to be predicted
  kConverged,     ///< ended: settled, and the fresh runs were predicted
  kNotConverged,  ///< ended at max_runs, or where more runs would be for nothing
  kRefused,       ///< ended: no posterior can be had so
};

/// A decision as later ones remember it; to be stored.
struct AdaptiveMemory {
  AdaptiveStage stage = AdaptiveStage::kFirst;
  Eigen::VectorXd mean{}, sd{};  ///< d, standardised; empty where there was no posterior
  int batches = 0;               ///< that had ended when it was taken
  int uncertain = 0;             ///< decisions in a row, this one last, by which a mean will be
                                 ///< known worse than to mean_error after max_runs
  int missing = 0;               ///< and by which the model misses the readings as well
};

/// Fresh runs of the posterior against what was predicted of them before.
struct AdaptiveVerification {
  int runs = 0;         ///< that completed
  int lost = 0;         ///< that did not
  double chance = 1;    ///< of a chi-squared as large, by Fisher's law
  double coverage = 1;  ///< share of their coordinates in 90 % intervals
  bool passed = false;
};

/// What to do next.
struct AdaptiveDecision {
  AdaptiveStage stage = AdaptiveStage::kFirst;
  AdaptiveBatch next{};  ///< no rows once ended
  /// One or more sentences: why it ends, what is uncertain, what more runs would bring. Empty while
  /// it goes on well.
  std::string reason{};
  bool propose_filter = false;  ///< the emulator is not fit for this model: weights may be
  std::optional<AdaptivePosterior> posterior{};
  std::optional<ResponseQuality> quality{};
  AdaptiveVerification verification{};  ///< of the last verifying batch, if it has just ended
  AdaptiveMemory memory{};
};

/// Runs of the first batch of d parameters.
int FirstRunsOf(Eigen::Index parameters, const AdaptiveOptions& options);
/// Least max_runs with which a calibration of d parameters can end well: first runs, two batches,
/// verification.
int LeastMaxRuns(Eigen::Index parameters, const AdaptiveOptions& options);

/// Whether a decision may be taken while the last of these batches is pending: it does not judge,
/// and others have ended before it. Where such a decision asks for no runs, that batch is waited
/// for and another one taken.
bool MayOverlap(std::span<const AdaptiveMemory> earlier);

/// The decision after batches that have ended; the last may be pending, all of it (MayOverlap):
/// then its places count, and nothing else. Settled is a posterior whose means and widths have
/// moved by less than the options say at each of the last two decisions, each of which knew more
/// batches than the one before, and whose means are known well enough (a mean may rest where the
/// emulator is wrong); then `verify` draws of it are run and predicted (Fisher's chi-squared above
/// one in a thousand, and at least seven tenths of the coordinates in their 90 % intervals). The
/// last runs of max_runs are kept for that. It also ends, not converged, where three decisions in a
/// row found that a mean would be known worse than to mean_error after max_runs, its error falling
/// with the root of the runs, and either the posterior has settled and fresh runs of it were
/// predicted (the error is in its widths, and the runs that are left would not take it out), or all
/// three found that the model misses the readings (a chance below one in a million of as large a
/// distance at the best draw, by noise, scatter and what the emulator does not know): the error of
/// a slope times a distance that no parameter closes moves the posterior, and no run mends it.
/// Refused: max_runs below LeastMaxRuns; no first run
/// complete, or too few; scatter that leaves no signal; runs that are missed by more than repeats
/// of them differ, or than the emulator claims. Deterministic in the arguments. Pure. in: all, runs
/// so far; earlier, of each batch so far the memory of the decision that asked for it, in order
/// Errors: INVALID_ARGUMENT for what does not fit.
absl::StatusOr<AdaptiveDecision> DecideAdaptive(const AdaptiveProblem& problem,
                                                const AdaptiveRuns& all,
                                                std::span<const AdaptiveMemory> earlier,
                                                const AdaptiveOptions& options);

}  // namespace calib::inference
