#include "inference/emulator/split_half.h"

#include <cmath>
#include <limits>
#include <vector>

#include "inference/sampling/shuffle.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kDraws = 500;  // the mean of so many is known to 0.05 sd

// One half of the runs that finished or were stopped, all iterations counted through.
std::vector<Iteration> HalfOf(std::span<const Iteration> iterations, int which) {
  Index runs = 0;
  for (const Iteration& iteration : iterations) runs += iteration.predictions.rows();
  const std::vector<int> half_of_run = Halves(runs);
  std::vector<Iteration> half;
  std::size_t run = 0;
  for (const Iteration& iteration : iterations) {
    std::vector<Index> rows;
    for (Index i = 0; i < iteration.predictions.rows(); ++i) {
      const bool stopped =
          iteration.stopped.rows() > i && iteration.stopped.row(i).array().isFinite().any();
      if ((stopped || iteration.predictions.row(i).allFinite()) && half_of_run[run++] == which) {
        rows.push_back(i);
      }
    }
    half.push_back({.proposal = iteration.proposal,
                    .parameters = iteration.parameters(rows, Eigen::all),
                    .predictions = iteration.predictions(rows, Eigen::all),
                    .log_proposal = {},
                    .stopped = iteration.stopped.rows() > 0 ? iteration.stopped(rows, Eigen::all)
                                                            : Eigen::MatrixXd()});
  }
  return half;
}

}  // namespace

SplitHalf SplitHalfOfEmulator(const JointPrior& priors, const DataSet& data,
                              const EmulatorOptions& options, std::span<const Iteration> iterations,
                              const EmulatedResult& whole, const std::stop_token& stop) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto d = static_cast<Index>(whole.parameters.size());
  SplitHalf split{.difference = Eigen::VectorXd::Constant(d, kNone), .log_evidence_error = kNone};
  EmulatorOptions of_half = options;
  of_half.draws = kDraws;
  of_half.replicates.reset();  // they move draws, not means
  of_half.path_draws = 0;
  Eigen::MatrixXd means(2, d);
  double log_evidence[2];
  for (int which = 0; which < 2; ++which) {
    const auto half = EmulatedPosterior(priors, data, of_half, HalfOf(iterations, which), stop);
    if (!half.ok() || half->draws.rows() == 0) return split;
    means.row(which) = half->draws.colwise().mean();
    log_evidence[which] = half->log_evidence;
  }
  for (Index j = 0; j < d; ++j) {
    split.difference[j] =
        std::abs(means(0, j) - means(1, j)) / whole.parameters[static_cast<std::size_t>(j)].sd;
  }
  split.log_evidence_error =
      std::hypot((log_evidence[0] - log_evidence[1]) / 2,
                 (log_evidence[0] + log_evidence[1]) / 2 - whole.log_evidence);
  return split;
}

}  // namespace calib::inference
