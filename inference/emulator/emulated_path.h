#pragma once
// The posterior along the readings, on an emulator: what the first load steps say alone, then with
// the next, up to all of them [Cheng 2019, sec. 3.3.2, where weighted samples are too few].

#include <cstdint>
#include <stop_token>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/emulator/emulated_likelihood.h"
#include "inference/emulator/emulated_target.h"
#include "inference/filter/iterative_filter.h"

namespace calib::inference {

/// Options of EmulatedPath. Chosen: the means of 400 draws are known to 0.08 sd.
struct EmulatedPathOptions {
  int draws = 400;         ///< carried along the path, [100, 1e5]
  double target_cv = 0.7;  ///< TmcmcOptions::target_cv of one move, (0, 2]
  int steps = 5;           ///< Metropolis steps of one move, >= 1
  std::uint64_t seed = 0;
};

/// The posterior after each load step: draws of the prior, as far as the emulator knows the model
/// there, are carried through the readings by resample-move [Chopin 2002; Del Moral et al. 2006].
/// Each load step weighs them; where fewer than half remain effective they are resampled and moved,
/// in several tempered parts where one load step says much. The last row is the emulated posterior
/// but for chance (before refits widen it). Means and cov of sampled parameters are off by about
/// 1.5 / sqrt(draws) of the sd; held parameters keep their value, cov 0. ess: share of the draws
/// that is effective. log_evidence is by the prior of EmulatedResult::log_evidence. Deterministic
/// in options.seed.
/// in: likelihood of `data`, in whose order the readings are taken in
/// Errors: FAILED_PRECONDITION where of 50 options.draws draws of the prior fewer than 50 lie where
/// the emulator knows the model; CANCELLED once `stop` is requested, looked at each load step.
absl::StatusOr<PosteriorPath> EmulatedPath(const EmulatedTarget& target,
                                           const EmulatedLikelihood& likelihood,
                                           const DataSet& data, const EmulatedPathOptions& options,
                                           const std::stop_token& stop = {});

}  // namespace calib::inference
