#pragma once
// The JSON documents of a server's campaigns, as `calibctl --json` prints them and the live page
// draws them.

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/client/load_view.h"
#include "server/report/views/comparison.h"
#include "server/report/views/curves.h"
#include "server/report/views/lineage.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::client {

// Errors of all: those of Client. shelf: where campaigns may have been read before; null: nowhere.

absl::StatusOr<std::string> ListDocument(Client& client, const Client::Part& part);
absl::StatusOr<std::string> ShowDocument(Client& client, const std::string& campaign);
/// Everything that a campaign comes from, and that comes from them (report::FamilyOf). NOT_FOUND:
/// there is no such campaign.
absl::StatusOr<std::vector<report::Branch>> FamilyOf(Client& client, const std::string& campaign);
absl::StatusOr<std::string> LineageDocument(Client& client, const std::string& campaign);
/// FAILED_PRECONDITION: no iteration is complete yet.
absl::StatusOr<std::string> PosteriorDocument(Client& client, const std::string& campaign,
                                              std::optional<int> iteration = std::nullopt,
                                              CampaignShelf* shelf = nullptr);
absl::StatusOr<std::string> SamplesDocument(Client& client, const std::string& campaign,
                                            CampaignShelf* shelf = nullptr);
absl::StatusOr<std::string> StatesDocument(Client& client, const std::string& campaign, int sample);
absl::StatusOr<std::string> WorkersDocument(Client& client);
/// The last one of its kind (findings.h) that was kept with the campaign; of diagnoses the one that
/// reports show (report::LatestOf). NOT_FOUND, a sentence with the command that makes one:
/// there is none.
absl::StatusOr<std::string> FindingDocument(Client& client, const std::string& campaign,
                                            const std::string& kind);

/// The diagnoses that were kept with the campaign and can be read, in the order in which they were.
absl::StatusOr<std::vector<report::StoredDiagnosis>> DiagnosesOf(Client& client,
                                                                 const std::string& campaign);

/// A campaign against its measurements, with all that `compare` tells.
struct Compared {
  bool is_known = false;  ///< an iteration is complete; else `note` says so, and there are curves
                          ///< of what was measured and run alone
  report::Comparison comparison;
  std::vector<report::ExperimentCurves> curves;
};
/// FAILED_PRECONDITION: it infers nothing.
absl::StatusOr<Compared> CompareInFull(Client& client, const std::string& campaign,
                                       CampaignShelf* shelf = nullptr);
absl::StatusOr<std::string> CompareDocument(Client& client, const std::string& campaign,
                                            CampaignShelf* shelf = nullptr);

/// Warnings of the last complete iteration; none before there is one.
absl::StatusOr<std::vector<std::string>> WarningsOf(Client& client, const std::string& campaign);

}  // namespace calib::client
