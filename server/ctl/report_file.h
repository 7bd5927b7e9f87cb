#pragma once
// The report of a campaign, as one file.

#include <string>

#include "absl/status/statusor.h"
#include "server/client/client.h"

namespace calib::ctl {

/// Whether this build has the page whose figures a report shows (CALIB_PAGE).
bool CanReport();

/// HTML that fetches nothing (report::ReportPage). Errors: those of client::ReportDocuments();
/// FAILED_PRECONDITION: !CanReport().
absl::StatusOr<std::string> ReportFile(client::Client& client, const std::string& campaign);

}  // namespace calib::ctl
