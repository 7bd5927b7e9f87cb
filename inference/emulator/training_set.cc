#include "inference/emulator/training_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/emulator/emulated_likelihood.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kFewestRuns = 10;      // and d + 4: a process has d + 2 hyper-parameters; chosen
constexpr Index kFewestRelevant = 40;  // TrainingOptions::relevant_runs
constexpr Index kRelevantPerParameter = 10;

// Rows from the best score down; equal scores in index order.
std::vector<Index> Ranking(const Eigen::VectorXd& scores) {
  std::vector<Index> order(static_cast<std::size_t>(scores.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return scores[a] > scores[b]; });
  return order;
}

// The first `best` of the order and `others` of the rest, evenly spaced; ascending.
std::vector<Index> BestAndOthers(const std::vector<Index>& order, std::size_t best,
                                 std::size_t others) {
  best = std::min(best, order.size());
  const std::size_t rest = order.size() - best;
  others = std::min(others, rest);
  std::vector<Index> chosen(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(best));
  for (std::size_t k = 0; k < others; ++k)
    chosen.push_back(order[best + (2 * k + 1) * rest / (2 * others)]);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Eigen::MatrixXd Rows(const Eigen::MatrixXd& matrix, const std::vector<Index>& rows) {
  Eigen::MatrixXd result(static_cast<Index>(rows.size()), matrix.cols());
  for (Index i = 0; i < result.rows(); ++i)
    result.row(i) = matrix.row(rows[static_cast<std::size_t>(i)]);
  return result;
}

struct Trained {
  StateEmulator emulator;
  std::vector<Index> rows;
};

absl::StatusOr<Trained> Train(const Runs& runs, std::vector<Index> rows,
                              const std::vector<Index>& relevant, const PrincipalOptions& options) {
  std::vector<Index> positions;
  for (const Index row : relevant) {
    const auto found = std::lower_bound(rows.begin(), rows.end(), row);
    if (found != rows.end() && *found == row) positions.push_back(found - rows.begin());
  }
  ASSIGN_OR_RETURN(
      auto emulator,
      StateEmulator::Fit(Rows(runs.inputs, rows), Rows(runs.histories, rows), positions, options));
  return Trained{.emulator = std::move(emulator), .rows = std::move(rows)};
}

// Log likelihood of every run's parameters by its emulated history: left out where the run was
// learned from.
absl::StatusOr<Eigen::VectorXd> EmulatedScores(const Runs& runs, const DataSet& data,
                                               const Trained& trained, double scatter_share) {
  ASSIGN_OR_RETURN(
      const auto likelihood,
      EmulatedLikelihood::Create(data, trained.emulator, {.scatter_share = scatter_share}));
  const Eigen::MatrixXd one_factor;
  Eigen::VectorXd scores =
      likelihood.LogLikelihood(trained.emulator.Predict(runs.inputs), one_factor);
  const Eigen::VectorXd left_out =
      likelihood.LogLikelihood(trained.emulator.PredictLeftOut(), one_factor);
  for (std::size_t i = 0; i < trained.rows.size(); ++i)
    scores[trained.rows[i]] = left_out[static_cast<Index>(i)];
  return scores;
}

// Sum over the relevant runs of the log density of their histories, noise added, as predicted from
// the other runs.
absl::StatusOr<double> LeftOutDensity(const Runs& runs, const DataSet& data, const Trained& trained,
                                      const std::vector<Index>& relevant) {
  ASSIGN_OR_RETURN(const auto likelihood,
                   EmulatedLikelihood::Create(data, trained.emulator, {.correlated_noise = false}));
  const ScorePrediction prediction = trained.emulator.PredictLeftOut();
  double sum = 0;
  for (std::size_t i = 0; i < trained.rows.size(); ++i) {
    const Index row = trained.rows[i];
    if (std::find(relevant.begin(), relevant.end(), row) == relevant.end()) continue;
    sum += likelihood.LogDensity(prediction, static_cast<Index>(i), runs.histories.row(row));
  }
  return sum;
}

}  // namespace

absl::Status TrainingOptions::Validate() const {
  const auto wrong = [](const char* name, double found, const char* allowed) {
    return absl::InvalidArgumentError(
        absl::StrCat("emulator: ", name, " is ", found, "; allowed is ", allowed, "."));
  };
  if (max_runs < 20 || max_runs > 2000) return wrong("max_runs", max_runs, "20 to 2000");
  if (relevant_runs < 0)
    return wrong("relevant_runs", relevant_runs, "0 (chosen by the number of parameters) or more");
  if (!(share_of_rest >= 0 && share_of_rest <= 1))
    return wrong("share_of_rest", share_of_rest, "0 to 1");
  if (!(scatter_share >= 0 && scatter_share <= 1))
    return wrong("scatter_share", scatter_share, "0 to 1");
  if (!(principal.truncation > 0 && principal.truncation < 1)) {
    return wrong("truncation", principal.truncation, "between 0 and 1");
  }
  if (principal.max_components < 1 || principal.max_components > 16) {
    return wrong("max_components", principal.max_components, "1 to 16");
  }
  return absl::OkStatus();
}

absl::StatusOr<TrainedEmulator> TrainEmulator(const Runs& runs, const DataSet& data,
                                              const TrainingOptions& options) {
  const Index n = runs.inputs.rows();
  const Index d = runs.inputs.cols();
  if (n < std::max<Index>(kFewestRuns, d + 4)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "an emulator of ", d, " parameters needs at least ", std::max<Index>(kFewestRuns, d + 4),
        " runs; there are ", n, " that came to their ends: run more samples."));
  }
  const auto wanted = static_cast<std::size_t>(
      options.relevant_runs > 0 ? options.relevant_runs
                                : std::max<Index>(kFewestRelevant, kRelevantPerParameter * d));
  const std::size_t count = std::min(wanted, static_cast<std::size_t>(n));
  const auto limit = std::max(static_cast<std::size_t>(options.max_runs), count);
  const auto first = [](const std::vector<Index>& order, std::size_t size) {
    return std::vector<Index>(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(size));
  };

  const std::vector<Index> by_outcome = Ranking(-runs.histories.rowwise().squaredNorm());
  ASSIGN_OR_RETURN(Trained broad,
                   Train(runs, BestAndOthers(by_outcome, limit / 2, limit - limit / 2),
                         first(by_outcome, std::min(count, limit / 2)), options.principal));
  ASSIGN_OR_RETURN(const auto scores, EmulatedScores(runs, data, broad, options.scatter_share));
  const std::vector<Index> order = Ranking(scores);
  std::vector<Index> relevant = first(order, count);

  const auto rest = static_cast<std::size_t>(
      options.share_of_rest * static_cast<double>(static_cast<std::size_t>(n) - count));
  auto local = Train(runs, BestAndOthers(order, count, std::min(rest, limit - count)), relevant,
                     options.principal);
  // The broad set judged on the same runs, as far as it holds them.
  std::vector<Index> common;
  for (const Index row : relevant) {
    if (std::binary_search(broad.rows.begin(), broad.rows.end(), row)) common.push_back(row);
  }
  if (common.size() >= count / 2) {
    ASSIGN_OR_RETURN(broad, Train(runs, broad.rows, common, options.principal));
  }
  bool use_local = local.ok();
  if (local.ok() && common.size() >= count / 2) {
    const auto locally = LeftOutDensity(runs, data, *local, common);
    const auto broadly = LeftOutDensity(runs, data, broad, common);
    use_local = locally.ok() && broadly.ok() && *locally > *broadly;
  }
  Trained& chosen = use_local ? *local : broad;
  return TrainedEmulator{.emulator = std::move(chosen.emulator),
                         .runs = static_cast<int>(chosen.rows.size()),
                         .relevant = use_local ? std::move(relevant) : std::move(common),
                         .local = use_local};
}

}  // namespace calib::inference
