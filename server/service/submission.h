#pragma once
// What is checked before a campaign, or a conclusion about one, is stored.

#include <variant>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/planning/growth.h"
#include "server/service/limits.h"
#include "server/store/reader.h"

namespace calib::service {

/// The campaign ready to be stored, or the problems found in it, what is beyond the limits among
/// them. FAILED_PRECONDITION: a file's content was not put. RESOURCE_EXHAUSTED: its files are
/// larger together than the server takes.
absl::StatusOr<std::variant<store::NewCampaign, v1::SubmitReply>> CheckSubmission(
    const v1::SubmitRequest& request, const Limits& limits, store::Reader& reader);

/// A conclusion ready to be stored. An equal one that is there already keeps its time. Errors:
/// those of the rpc AddFinding.
struct NewFinding {
  std::int64_t campaign = 0;
  store::FindingRecord record{};
};
absl::StatusOr<NewFinding> CheckFinding(const v1::AddFindingRequest& request, std::int64_t unix_ms,
                                        store::Reader& reader);

/// The runs that a request adds. INVALID_ARGUMENT: it has none, or no stage of a design. What it
/// takes to know more is the scheduler's (PlanGrowth).
absl::StatusOr<planning::NewRuns> CheckRuns(const v1::AddRunsRequest& request);

/// SHA-256 of everything in the request but its id.
std::string ContentDigest(const v1::SubmitRequest& request);

}  // namespace calib::service
