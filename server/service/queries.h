#pragma once
// Answers to what users ask, from one Reader. Pure functions of the store and of what the scheduler
// said.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/scheduler/scheduler.h"
#include "server/store/reader.h"

namespace calib::service {

/// "c12" -> 12; NOT_FOUND for anything else.
absl::StatusOr<std::int64_t> ParseCampaign(const std::string& id);

/// live: what the scheduler knows beyond the store; empty: nothing, the campaign is over. waits:
/// what the server waits for; empty: nothing. A stored posterior that cannot be read is said in
/// `problem`.
absl::StatusOr<v1::CampaignStatus> StatusOf(store::Reader& reader, std::int64_t campaign,
                                            const std::optional<scheduler::LiveStatus>& live,
                                            const std::string& waits = "");
/// The status of every campaign, in the order of their ids. One that cannot be told says so in
/// `problem`.
absl::StatusOr<v1::ListReply> ListOf(store::Reader& reader,
                                     const std::map<std::int64_t, scheduler::LiveStatus>& live,
                                     const std::string& waits = "");
absl::StatusOr<v1::Posterior> PosteriorOf(store::Reader& reader, std::int64_t campaign,
                                          std::optional<int> iteration);
absl::StatusOr<std::vector<v1::Sample>> SamplesOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<v1::CampaignSource> SourceOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<v1::FindingList> FindingsOf(store::Reader& reader, std::int64_t campaign);
absl::StatusOr<std::vector<v1::LogEntry>> LogOf(store::Reader& reader, std::int64_t campaign);

}  // namespace calib::service
