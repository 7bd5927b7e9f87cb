#pragma once
// What a diagnosis stands on: whether a campaign can be judged at all, and what makes any verdict
// doubtful.

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/campaign/model/campaign.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// FAILED_PRECONDITION with a sentence where nothing can be said: no complete iteration, no stated
/// errors, no more readings than parameters, no finished sample.
absl::Status CheckDiagnosable(const report::CampaignView& view);

/// INVALID_ARGUMENT for a name that is no effect of the catalogue or of the campaign.
absl::Status CheckLeftOut(const std::vector<std::string>& effects,
                          const campaign::Campaign& campaign);

/// Fewer than five for each calibrated parameter and one more.
bool HasFewReadings(const campaign::Campaign& campaign);

/// Sentences: few readings, one packing only.
std::vector<std::string> DoubtsOf(const campaign::Campaign& campaign);

/// A sentence on what a scatter known from few packings does to the verdict; empty where it is
/// known from enough, or where packings were not varied. measured: packings that the best estimate
/// was run on; apart: PackingsApart().
std::string FewPackings(int measured, int apart);

}  // namespace calib::diagnosis
