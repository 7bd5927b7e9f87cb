#pragma once
// The family of a campaign as the server knows it.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/stored_diagnosis.h"
#include "server/report/views/story.h"

namespace calib::ctl {

/// What was kept of a campaign's diagnoses, the oldest first. Documents that another version wrote
/// and this one cannot read are passed over.
absl::StatusOr<std::vector<report::StoredDiagnosis>> LoadDiagnoses(client::Client& client,
                                                                   const std::string& campaign);

/// Ancestors of the campaign by extension, or the models of the improvement that it took part in;
/// all that was tried on any of them, and their errors. Drift of the parameters where it can be
/// told.
absl::StatusOr<report::Story> LoadStory(client::Client& client, const report::CampaignView& view);

}  // namespace calib::ctl
