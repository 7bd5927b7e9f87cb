#pragma once
// Split-half agreement of emulated posteriors: what another set of runs would have said.

#include <Eigen/Core>
#include <span>
#include <stop_token>

#include "inference/data/data_set.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// How two posteriors from half of the runs each differ.
struct SplitHalf {
  /// Difference of the means of two posteriors over the sd of `whole`, d entries: each is sampled
  /// on an emulator of one of each pair of runs, `whole` on one of all runs of the same
  /// iterations. Pessimistic, as half of the runs teach an emulator less. NaN for parameters that
  /// are held, and for all where half of the runs give no posterior at all.
  Eigen::VectorXd difference;
  /// What the log evidence owes to these runs and no others, one standard deviation: half of what
  /// the halves differ by, and what they are off from the whole on average (a half is off by about
  /// twice what the whole is); NaN where half of the runs give no posterior at all.
  double log_evidence_error = 0;
};

/// Compares the posteriors on emulators of two halves of the runs of some iterations; whole: the
/// posterior on one of all. It costs two trainings, as that of `whole`, and 500 draws of each.
/// Deterministic in options.seed.
SplitHalf SplitHalfOfEmulator(const JointPrior& priors, const DataSet& data,
                              const EmulatorOptions& options, std::span<const Iteration> iterations,
                              const EmulatedResult& whole, const std::stop_token& stop = {});

}  // namespace calib::inference
