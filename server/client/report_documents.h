#pragma once
// What a report of a campaign shows.

#include <string>

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/report/documents/report_page.h"

namespace calib::client {

/// All that is there of the campaign: itself, compare, posterior, sensitivity, diagnosis,
/// improvement, lineage, record; and of the models that its last improvement began with and ended
/// in, what they are and how they fit. Errors: those of Client; NOT_FOUND: there is no such
/// campaign.
absl::StatusOr<report::DocumentsByPath> ReportDocuments(Client& client,
                                                        const std::string& campaign);

}  // namespace calib::client
