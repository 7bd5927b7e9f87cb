#pragma once
// A campaign file on this machine with the files it names: what validate, submit, run and simulate
// begin with.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/campaign/file/campaign_file.h"
#include "server/client/client.h"

namespace calib::ctl {

struct SourceFiles {
  std::string yaml;
  std::string file_name;  ///< without folders
  campaign::ReadOutcome outcome;
  std::map<std::string, std::string> contents;  ///< path as written -> content
};

/// Reads and validates the campaign file. seed: replaces the file's. With problems nothing is
/// returned: they are printed, one line each on standard error or, with `json`, as one document on
/// standard output; the exit code is then kBadInput.
std::optional<SourceFiles> ReadSourceFiles(const std::string& file,
                                           std::optional<std::uint64_t> seed, bool json);

/// Puts the files and submits. The request id is the identity digest: submitting the same again
/// gives the same campaign. Returns the campaign id. INVALID_ARGUMENT when the server refuses (its
/// problems are printed).
absl::StatusOr<std::string> SubmitSource(client::Client& client, const SourceFiles& source,
                                         std::optional<std::uint64_t> seed,
                                         const std::string& file);

/// For a file whose campaign was cancelled: it would never run.
absl::Status CancelledBefore(const std::string& campaign);

}  // namespace calib::ctl
