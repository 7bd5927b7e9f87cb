#pragma once
// Answers to what users ask, from one Reader. Pure functions of the store and of what the scheduler
// said.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/campaign.pb.h"
#include "server/scheduler/scheduler.h"
#include "server/store/reader.h"

namespace calib::service {

/// "c12" -> 12; NOT_FOUND for anything else.
absl::StatusOr<std::int64_t> ParseCampaign(const std::string& id);

/// Statuses of campaigns that have finished, counted once: nothing changes in them any more but
/// what an attempt that was under way has cost.
/// Thread-safe.
class FinishedStatuses {
 public:
  /// As it was kept; empty: it was not, or the campaign has gone on since.
  std::optional<v1::CampaignStatus> Find(const store::CampaignRecord& record) const;
  /// Keeps the status of a campaign that has finished, and of no other.
  void Keep(const store::CampaignRecord& record, const v1::CampaignStatus& status);

 private:
  struct Kept {
    int iteration = 0;  // a design goes on by a further batch
    v1::CampaignStatus status;
  };
  mutable absl::Mutex mutex_;
  std::map<std::int64_t, Kept> kept_ ABSL_GUARDED_BY(mutex_);
};

/// FAILED_PRECONDITION, a sentence: the campaign was pruned, and not all of its states are there.
absl::Status CheckHasStates(const store::CampaignRecord& record);

/// Which campaigns come from which: a campaign's text stays what it is, so that each is read once.
/// Thread-safe.
class Descent {
 public:
  /// Those that come from this one and are there, in the order of their ids.
  absl::StatusOr<std::vector<store::CampaignRecord>> ChildrenOf(store::Reader& reader,
                                                                std::int64_t parent);

 private:
  absl::Mutex mutex_;
  std::int64_t read_to_ ABSL_GUARDED_BY(mutex_) = 0;  // id of the last that was read
  std::multimap<std::int64_t, std::int64_t> children_ ABSL_GUARDED_BY(mutex_);
};

/// live: what the scheduler knows beyond the store; empty: nothing, the campaign is over. waits:
/// what the server waits for; empty: nothing. finished: what is known already. A stored posterior
/// that cannot be read is said in `problem`.
absl::StatusOr<v1::CampaignStatus> StatusOf(store::Reader& reader, std::int64_t campaign,
                                            const std::optional<scheduler::LiveStatus>& live,
                                            const std::string& waits = "",
                                            FinishedStatuses* finished = nullptr);
/// The campaigns that a question is about. NOT_FOUND: none was ever called as `after` or `parent`.
absl::StatusOr<std::vector<store::CampaignRecord>> Asked(store::Reader& reader,
                                                         const v1::ListRequest& request,
                                                         Descent& descent);
/// The status of each of these. One that cannot be told says so in `problem`.
absl::StatusOr<v1::ListReply> ListOf(store::Reader& reader,
                                     const std::vector<store::CampaignRecord>& campaigns,
                                     const std::map<std::int64_t, scheduler::LiveStatus>& live,
                                     const std::string& waits = "",
                                     FinishedStatuses* finished = nullptr);
absl::StatusOr<v1::Posterior> PosteriorOf(store::Reader& reader, std::int64_t campaign,
                                          std::optional<int> iteration);
absl::StatusOr<std::vector<v1::Sample>> SamplesOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<v1::CampaignSource> SourceOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<v1::FindingList> FindingsOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<std::vector<v1::LogEntry>> LogOf(store::Reader& reader, std::int64_t campaign);

}  // namespace calib::service
