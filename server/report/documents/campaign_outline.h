#pragma once
// A campaign file to begin with, of which every line can be kept or changed.

#include <string>

#include "absl/status/statusor.h"

namespace calib::report {

/// The text of a campaign of one experiment: all that the contact law and the test need, with
/// defaults and ranges of the catalogue in comments. It is a good campaign once the table that it
/// names is there.
/// INVALID_ARGUMENT, one sentence: no such test or contact law.
absl::StatusOr<std::string> CampaignOutline(const std::string& test, const std::string& contact);

}  // namespace calib::report
