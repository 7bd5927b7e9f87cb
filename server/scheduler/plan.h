#pragma once
// What comes next for a campaign, computed from the store alone: the same records give the same
// bits, whatever the order in which workers delivered them and however often the server was killed
// in between.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/scheduler/definition.h"
#include "server/scheduler/transitions.h"
#include "server/store/reader.h"
#include "server/store/transaction.h"

namespace calib::scheduler {

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

/// The step after everything planned so far has ended: the first iteration; posterior and next
/// iteration; posterior and validation; the end. While evaluations are under way (decisions.h):
/// points that can be chosen by now, the posterior of an iteration that has ended, thresholds; or
/// nothing. Errors: those of the store. What inference cannot do becomes a plan with event kFail.
absl::StatusOr<Plan> PlanNext(const Definition& definition, const store::CampaignRecord& campaign,
                              store::Reader& reader);

/// Writes a plan. progress: of the campaign after it.
void Write(const Plan& plan, std::int64_t campaign, const store::CampaignProgress& progress,
           std::int64_t unix_ms, store::Transaction& transaction);

}  // namespace calib::scheduler
