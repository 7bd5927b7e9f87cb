#pragma once
// A campaign file from inspected tables: what is known of the measurement stands in it, the rest
// are defaults, each with a comment that asks to be confirmed.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/inspection/inspection_json.h"

namespace calib::inspection {

struct DraftQuestion {
  std::string test{};           ///< lab test that reproduces the measurements
  std::string campaign_file{};  ///< where the text will stand: paths are written relative to it
  std::string sheet{};          ///< of the workbooks among the files; empty: none was named
};

/// The text of a campaign file with one experiment for each test of each file. Reads and writes
/// nothing.
/// Precondition: every file could be inspected, and none is open.
/// Errors, one sentence: INVALID_ARGUMENT (no such test; a test that is not of a specimen in the
/// periodic cell; a file without its control or without anything that it can be compared by).
absl::StatusOr<std::string> CampaignDraft(const std::vector<InspectedFile>& files,
                                          const DraftQuestion& question);

}  // namespace calib::inspection
