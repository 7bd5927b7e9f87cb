#pragma once
// The service as seen by calibctl: one blocking call per question. No gRPC header is needed to use
// it.

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "proto/rpc/access.h"
#include "server/messages/backup_seal.h"

namespace grpc {
class Channel;
}

namespace calib::client {

/// Errors of all calls: UNAVAILABLE when the server is not there, DEADLINE_EXCEEDED when it is but
/// has not answered for minutes, UNAUTHENTICATED and PERMISSION_DENIED when it does not let this
/// program do that, otherwise the codes of the service definition. Not thread-safe.
class Client {
 public:
  /// UNAVAILABLE when nothing answers at the address within about two seconds;
  /// FAILED_PRECONDITION or PERMISSION_DENIED when what answers there cannot be talked to
  /// (rpc::WhyNotConnected). access: what is shown there. Where that has changed when the
  /// server refuses it, as a certificate that was renewed, the call is made once more.
  static absl::StatusOr<std::unique_ptr<Client>> Connect(const std::string& address,
                                                         const rpc::AccessChoice& access = {});
  /// Of a server in this very process (service::Server::InProcessChannel). One that is lost is not
  /// waited for.
  static std::unique_ptr<Client> Over(std::shared_ptr<grpc::Channel> channel);
  /// Where a server is, and what is shown there.
  struct Place {
    std::string address{};  ///< empty: it is hopeless to look for one
    rpc::AccessChoice access{};
  };
  /// How to find the server again when the connection is lost. Without it the same is tried.
  using FindServer = std::function<Place()>;
  void OnLoss(FindServer find_server);
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  absl::Status PutBlob(const std::string& content);
  absl::StatusOr<std::string> GetBlob(const std::string& digest);
  absl::StatusOr<v1::SubmitReply> Submit(const v1::SubmitRequest& request);
  absl::StatusOr<v1::CampaignStatus> AddRuns(const v1::AddRunsRequest& request);
  /// Some of the campaigns, in the order of their ids.
  struct Part {
    std::optional<int> limit{};  ///< at most so many
    std::string after{};         ///< those behind this one; empty: from the first
    std::string parent{};        ///< only those that come from this one; empty: any
  };
  /// NOT_FOUND: no campaign was ever called as `after` or `parent`.
  absl::StatusOr<std::vector<v1::CampaignStatus>> List(const Part& part);
  absl::StatusOr<std::vector<v1::CampaignStatus>> List() { return List(Part{}); }
  absl::StatusOr<v1::CampaignStatus> Show(const std::string& campaign);
  /// Calls `seen` with every status until the campaign ends.
  absl::Status Watch(const std::string& campaign,
                     const std::function<void(const v1::CampaignStatus&)>& seen);
  /// Calls `seen` with every message of WatchChanges until `stop`, or until the server is lost
  /// (UNAVAILABLE), which is not waited for.
  absl::Status WatchChanges(const std::stop_token& stop,
                            const std::function<void(const v1::Changes&)>& seen);
  absl::StatusOr<v1::Posterior> GetPosterior(const std::string& campaign,
                                             std::optional<int> iteration);
  absl::StatusOr<std::vector<v1::Sample>> GetSamples(const std::string& campaign);
  absl::StatusOr<std::vector<v1::SampleStates>> GetStates(const std::string& campaign,
                                                          std::optional<int> sample);
  absl::StatusOr<v1::CampaignSource> GetSource(const std::string& campaign);
  absl::StatusOr<std::vector<v1::LogEntry>> GetLog(const std::string& campaign);
  /// Puts the document and keeps it as a conclusion about the campaign. kind: diagnosis |
  /// improvement.
  absl::Status AddFinding(const std::string& campaign, const std::string& kind,
                          const std::string& document);
  absl::StatusOr<std::vector<v1::Finding>> Findings(const std::string& campaign);
  absl::StatusOr<v1::CampaignStatus> Pause(const std::string& campaign);
  absl::StatusOr<v1::CampaignStatus> Resume(const std::string& campaign);
  absl::StatusOr<v1::CampaignStatus> Cancel(const std::string& campaign);
  /// priority: from -100 to 100.
  absl::StatusOr<v1::CampaignStatus> SetPriority(const std::string& campaign, int priority);
  /// Slots that an owner's runs hold at most; empty: no bound.
  absl::StatusOr<v1::OwnerShare> SetQuota(const std::string& owner, std::optional<int> slots);
  absl::StatusOr<std::vector<v1::OwnerShare>> ListShares();
  absl::Status Delete(const std::string& campaign);
  absl::StatusOr<std::vector<v1::WorkerInfo>> ListWorkers();
  /// within: at most a day; runs that have not ended by then go on elsewhere. 0: they end.
  absl::StatusOr<v1::WorkerInfo> DrainWorker(const std::string& worker,
                                             std::chrono::milliseconds within = {});
  absl::StatusOr<v1::ServerReport> Examine();
  absl::StatusOr<v1::Metrics> GetMetrics();
  /// What takes a backup as it comes.
  struct BackupSink {
    std::function<absl::Status()> begin{};  ///< what came before is void; called at least once
    std::function<absl::Status(const std::string&)> add{};
  };
  /// A backup of all the server holds; the sink has got all of it when this is OK. Errors of the
  /// sink end it.
  absl::StatusOr<messages::BackupSeal> Backup(const BackupSink& sink);
  /// keep_states: of each campaign that is over, those of so many samples.
  absl::StatusOr<v1::PruneReply> Prune(std::optional<int> keep_states);

 private:
  struct Impl;
  explicit Client(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::client
