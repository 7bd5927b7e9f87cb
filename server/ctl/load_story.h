#pragma once
// The family of a campaign as the server knows it.

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/story.h"

namespace calib::ctl {

/// Ancestors of the campaign by extension, or the models of the improvement that it took part in;
/// all that was tried on any of them, and their errors. Drift of the parameters where it can be
/// told.
absl::StatusOr<report::Story> LoadStory(client::Client& client, const report::CampaignView& view);

}  // namespace calib::ctl
