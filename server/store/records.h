#pragma once
// Rows as the rest of the server sees them. Plain values; doubles survive the store bit for bit.

#include <compare>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/model/words.h"

namespace calib::store {

using campaign::CampaignState;
using campaign::EvaluationStatus;
using campaign::Phase;

/// A number that is not known yet; NULL in the store.
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// A campaign as submitted, before anything has happened to it.
struct NewCampaign {
  std::int64_t id = 0;  ///< above every id used before (Reader::LastCampaign)
  std::string name{};
  std::string yaml{};
  std::string file_name{};
  std::optional<std::uint64_t> seed{};
  std::string method{};  ///< its name
  int samples = 0;
  int max_iterations = 1;
  std::int64_t created_unix_ms = 0;
  int reading_rules = 1;  ///< number of those by which its measurements are read
  std::string owner{};    ///< who submitted it; empty: nobody knows
};

/// What changes while a campaign lives.
struct CampaignProgress {
  CampaignState state = CampaignState::kQueued;
  std::string reason{};
  Phase phase = Phase::kCalibrating;
  int iteration = 0;
  bool converged = false;
  bool pause_waived = false;  ///< it was resumed although too many samples diverged

  friend bool operator==(const CampaignProgress&, const CampaignProgress&) = default;
};

struct CampaignRecord {
  NewCampaign submitted{};
  CampaignProgress progress{};
  std::optional<int> kept_states{};  ///< samples whose states it was pruned to; empty: it was not
  int priority = 0;                  ///< among its owner's campaigns; the highest first
};

/// A piece of what is removed.
struct Removed {
  int count = 0;      ///< rows, or pages of the file
  bool more = false;  ///< something is left to be removed
};

struct IterationRecord {
  int number = 0;
  std::string proposal{};                  ///< JSON
  std::optional<std::string> posterior{};  ///< JSON; empty while the iteration runs
};

struct SampleRecord {
  int sample = 0;
  int iteration = 0;
  std::vector<double> parameters{};
  double log_weight = kUnknown;
  double log_likelihood = kUnknown;
  /// The sample is stopped when the largest log likelihood that it can still reach falls below
  /// this; unknown: it is never stopped.
  double stop_below = kUnknown;
  /// For a sample that was stopped and is run to its end to see what that would have lost: the
  /// share of the finished mass that its bound left it. Unknown: not audited.
  double audited = kUnknown;
  /// Decides on packing and seed, >= 0; empty: campaign::StreamOf().
  std::optional<int> stream{};
};

/// Names one model evaluation; its order is the order in which work is handed out.
struct EvaluationKey {
  std::int64_t campaign = 0;
  int sample = 0;
  int experiment = 0;

  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the zero compared with for a pointer
  friend auto operator<=>(const EvaluationKey&, const EvaluationKey&) = default;
};

struct EvaluationRecord {
  EvaluationKey key{};
  EvaluationStatus status = EvaluationStatus::kWaiting;
  std::string reason{};
  int failures = 0;  ///< attempts whose engine or program failed
  int losses = 0;    ///< that were lost with their node, or failed by it
  std::string digest{};
  bool reused = false;
  std::optional<int> rest_after{};  ///< load step at which it rests; empty: it runs to its end
  std::string held_in{};            ///< checkpoint folder that can go on with it; empty: none
};

/// An attempt that a worker holds.
struct ActiveAttempt {
  std::int64_t id = 0;
  EvaluationKey key{};
  std::string worker{};
};

/// An attempt as it is leased to a worker.
struct NewAttempt {
  std::int64_t id = 0;
  EvaluationKey key{};
  std::string worker{};
  std::string cpu{};
  std::string engine{};
  std::int64_t started_unix_ms = 0;
};

/// How an attempt ended.
enum class AttemptOutcome {
  kCompleted,
  kResting,  ///< at a rung, from where its evaluation can go on
  kStoppedEarly,
  kStopped,  ///< its worker left, or other mechanics have to run it
  kDiverged,
  kFailed,
  kModelFailed,  ///< its program ended as it must not
  kLost,         ///< nothing was heard of it any more
  kCancelled
};
inline constexpr std::size_t kAttemptOutcomes = 9;  ///< the last is kCancelled
const char* ToString(AttemptOutcome outcome);

/// A file of a program's scratch folder that stays with its run.
struct KeptFile {
  std::string name{};
  std::string digest{};  ///< of a blob; empty: it does not stay
  std::string reason{};  ///< why not
};

/// What is recorded when an attempt ends.
struct AttemptEnd {
  std::int64_t id = 0;
  AttemptOutcome outcome = AttemptOutcome::kFailed;
  std::string reason{};
  std::int64_t ended_unix_ms = 0;
  std::int64_t steps = 0;
  std::int64_t contact_updates = 0;
  double core_seconds = 0;
  std::string staging{};
  std::string words{};  ///< of a program that failed: what it printed last on standard error
  std::vector<KeptFile> kept{};  ///< each name once counts, the last; of an unknown blob none stays
};

struct StateRecord {
  EvaluationKey key{};
  int load_step = 0;
  std::vector<double> observables{};
  std::string others{};  ///< JSON object of what a program told besides; empty: nothing
};

/// What the log of the server as a whole calls a backup that was taken whole.
inline constexpr const char* kBackupEvent = "backup";

struct EventRecord {
  std::int64_t unix_ms = 0;
  std::string what{};
};

/// A conclusion about a campaign; what it says is the blob of its digest.
struct FindingRecord {
  std::string kind{};  ///< diagnosis | improvement
  std::string digest{};
  std::int64_t created_unix_ms = 0;
};

/// What was asked under a request_id, and what was answered.
struct RequestRecord {
  std::string digest{};
  std::string answer{};
};

/// Work done for a campaign.
struct Effort {
  std::int64_t model_evaluations = 0;  ///< run to an end here (reused ones are not counted again)
  double core_seconds = 0;
};

}  // namespace calib::store
