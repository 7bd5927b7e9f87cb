#pragma once
// A calibration method as the planner sees it: which samples come first, and what follows from all
// that have ended.

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "server/planning/answer.h"
#include "server/planning/definition.h"
#include "server/planning/history.h"

namespace calib::planning {

/// What a method does not say of its answer.
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Samples to be evaluated together: one iteration of the store.
struct Batch {
  std::string proposal;            ///< JSON, what the method wants to know of it again
  Eigen::MatrixXd parameters;      ///< n x d
  std::vector<double> stop_below;  ///< n: see store::SampleRecord
  /// n or empty: needs no evaluation, whatever its likelihood it counts for nothing.
  std::vector<char> refused;
  /// n or empty: SampleRecord::stream of each, which decides on its packing and seed.
  std::vector<int> streams{};
  bool continues = false;  ///< with the last iteration; `proposal` is then that of all its samples
};

/// What a campaign has come to with the batch that has just ended.
struct Outcome {
  Answer answer;
  bool converged = false;
  std::string log;            ///< for the campaign's log, a clause
  std::optional<Batch> next;  ///< empty: the calibration is over
};

/// Pure functions of what the store holds. Errors: what inference cannot do, in a sentence;
/// DATA_LOSS where the records do not belong together.
class Planner {
 public:
  virtual ~Planner() = default;
  virtual absl::StatusOr<Batch> First() const = 0;
  /// history: at least one batch, all of it ended. affordable: another batch is within the budget
  /// (of a method that chooses while runs are under way: more points have been chosen).
  virtual absl::StatusOr<Outcome> Conclude(const History& history, bool affordable) const = 0;
  /// Points that can be chosen while others are under way, at most `affordable` of them, and no
  /// more than go into one iteration. No rows: none before more has ended, or never again.
  virtual absl::StatusOr<Batch> More(const History& /*history*/,
                                     std::int64_t /*affordable*/) const {
    return Batch{};
  }
  /// (sample, SampleRecord::stop_below) of samples under way, where what has arrived gives another
  /// threshold than the one they have. Asked of campaigns that decide at once.
  virtual absl::StatusOr<std::vector<std::pair<int, double>>> Thresholds(
      const History& /*history*/) const {
    return std::vector<std::pair<int, double>>{};
  }
};

/// ln p(data | sample) of every sample of the history's iterations from `first` on, in order; -inf:
/// it has no finite prediction.
absl::StatusOr<std::vector<Eigen::VectorXd>> LogLikelihoodsByBatch(const Definition& definition,
                                                                   const History& history,
                                                                   std::size_t first = 0);

}  // namespace calib::planning
