#pragma once
// What a report of a campaign shows.

#include <string>

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/report/documents/report_page.h"

namespace calib::client {

/// All that is there of the campaign: itself, compare, posterior, sensitivity, diagnosis,
/// improvement, lineage, record; and of the model that its last improvement ended in, what it is
/// and how it fits. Errors: those of Client; NOT_FOUND: there is no such campaign.
absl::StatusOr<report::DocumentsByPath> ReportDocuments(Client& client,
                                                        const std::string& campaign);

}  // namespace calib::client
