#pragma once
// A step of a campaign, as it is written to the store.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/v1/campaign.pb.h"
#include "server/planning/transitions.h"
#include "server/store/transaction.h"

namespace calib::planning {

/// The end of one iteration.
struct Conclusion {
  int iteration = 0;
  v1::Posterior posterior;
  std::vector<int> samples;             ///< of the campaign so far, by number
  std::vector<double> log_weights;      ///< of each
  std::vector<double> log_likelihoods;  ///< likewise; NaN with ess_target
};

/// A new iteration, or more samples of the last one.
struct Start {
  int iteration = 0;
  std::string proposal;  ///< JSON, of all its samples
  std::vector<store::SampleRecord> samples;
  bool continues = false;  ///< the iteration is there already
};

/// Everything to be written, in one transaction.
struct Plan {
  std::optional<Conclusion> conclusion;
  std::optional<Start> start;
  std::optional<Start> draws;  ///< from the posterior, for held-out experiments
  std::vector<store::EvaluationRecord> evaluations;  ///< new ones
  std::vector<std::pair<store::EvaluationKey, store::EvaluationKey>>
      reused;  ///< (done before, the same now)
  /// Stopped early or resting, to be run on after all.
  struct Resumed {
    store::EvaluationKey key;
    std::optional<int> rest_after;  ///< its next rung; empty: to its end
  };
  std::vector<Resumed> resumed;
  /// (sample, share that its bound leaves it): among them, run to their ends to be looked at.
  std::vector<std::pair<int, double>> audited;
  /// (sample under way, SampleRecord::stop_below), where what has arrived moves it.
  std::vector<std::pair<int, double>> stop_below;
  std::vector<store::StateRecord> states;                 ///< of runs made elsewhere
  campaign::Phase phase = campaign::Phase::kCalibrating;  ///< afterwards
  bool converged = false;
  std::optional<CampaignEvent> event;  ///< start, finish or fail
  std::string reason;                  ///< of a failure
  std::vector<std::string> log;
};

/// Writes a plan. progress: of the campaign after it.
void Write(const Plan& plan, std::int64_t campaign, const store::CampaignProgress& progress,
           std::int64_t unix_ms, store::Transaction& transaction);

}  // namespace calib::planning
