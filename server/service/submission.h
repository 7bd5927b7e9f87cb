#pragma once
// What is checked before a campaign is stored.

#include <variant>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/store/reader.h"

namespace calib::service {

/// The campaign ready to be stored, or the problems found in it. FAILED_PRECONDITION: a file's
/// content was not put.
absl::StatusOr<std::variant<store::NewCampaign, v1::SubmitReply>> CheckSubmission(
    const v1::SubmitRequest& request, store::Reader& reader);

/// SHA-256 of everything in the request but its id.
std::string ContentDigest(const v1::SubmitRequest& request);

}  // namespace calib::service
