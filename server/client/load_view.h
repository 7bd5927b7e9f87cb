#pragma once
// Everything the server knows of one campaign, fetched for tables, reports and exports.

#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "server/client/client.h"
#include "server/report/views/campaign_view.h"

namespace calib::client {

/// Campaigns that were read from what was submitted, the last few of them: who asks often reads
/// each once. Thread-safe.
class CampaignShelf {
 public:
  using Read = std::shared_ptr<const campaign::Campaign>;
  /// Errors: as LoadCampaign().
  absl::StatusOr<Read> Get(Client& client, const v1::CampaignSource& source);

 private:
  absl::Mutex mutex_;
  std::deque<std::pair<std::string, Read>> last_ ABSL_GUARDED_BY(mutex_);  // by source
};

/// Reads the campaign again from the file and the contents that were submitted. A campaign without
/// a complete iteration has an empty posterior.
/// shelf: where it may have been read before; null: nowhere.
absl::StatusOr<report::CampaignView> LoadView(Client& client, const std::string& campaign,
                                              CampaignShelf* shelf = nullptr);

/// The campaign alone, from what was submitted.
absl::StatusOr<campaign::Campaign> LoadCampaign(Client& client, const v1::CampaignSource& source);

/// State histories by (experiment, sample).
absl::StatusOr<std::map<std::pair<std::string, int>, report::StateHistory>> LoadStates(
    Client& client, const std::string& campaign, std::optional<int> sample);

}  // namespace calib::client
