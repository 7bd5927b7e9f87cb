#pragma once
// What somebody who looks at a campaign may do next.

#include <string>

#include "calib/v1/campaign.pb.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::report {

/// "calibctl diagnose c1"; empty: there is nothing to be done. diagnosis: the one of the campaign
/// that reports show (LatestOf); null: none was made. improved: an improvement began with it. Pure.
std::string NextCommand(const v1::CampaignStatus& status, const StoredDiagnosis* diagnosis,
                        bool improved);

}  // namespace calib::report
