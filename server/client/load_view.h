#pragma once
// Everything the server knows of one campaign, fetched for tables, reports and exports.

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/report/views/campaign_view.h"

namespace calib::client {

/// Reads the campaign again from the file and the contents that were submitted. A campaign without
/// a complete iteration has an empty posterior.
absl::StatusOr<report::CampaignView> LoadView(Client& client, const std::string& campaign);

/// The campaign alone, from what was submitted.
absl::StatusOr<campaign::Campaign> LoadCampaign(Client& client, const v1::CampaignSource& source);

/// State histories by (experiment, sample).
absl::StatusOr<std::map<std::pair<std::string, int>, report::StateHistory>> LoadStates(
    Client& client, const std::string& campaign, std::optional<int> sample);

}  // namespace calib::client
