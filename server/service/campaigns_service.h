#pragma once
// The Campaigns rpcs. Questions are answered on the pool from a Reader; changes go through the
// strand.

#include <atomic>
#include <functional>
#include <string>
#include <utility>

#include "calib/v1/campaign.grpc.pb.h"
#include "server/service/calls.h"
#include "server/service/core.h"
#include "server/service/guard.h"
#include "server/service/queries.h"
#include "server/service/requests.h"
#include "server/service/state_pieces.h"
#include "server/service/submission.h"

namespace calib::service {

class CampaignsService final : public v1::Campaigns::CallbackService {
 public:
  /// Where the server is, for those who ask.
  struct Site {
    std::string state_folder;
    std::string listen;  ///< HOST:PORT as it was told, or unix:/PATH
    std::string tls{};   ///< folder of its certificate; empty: none
  };
  CampaignsService(Core& core, Site site) : core_(core), site_(std::move(site)) {}

  using Context = grpc::CallbackServerContext;
  using Unary = grpc::ServerUnaryReactor;

  grpc::ServerReadReactor<v1::BlobChunk>* PutBlob(Context*, v1::BlobReceipt* reply) override;
  Unary* Submit(Context*, const v1::SubmitRequest*, v1::SubmitReply*) override;
  Unary* AddRuns(Context*, const v1::AddRunsRequest*, v1::CampaignStatus*) override;
  Unary* List(Context*, const v1::ListRequest*, v1::ListReply*) override;
  Unary* Show(Context*, const v1::CampaignRequest*, v1::CampaignStatus*) override;
  grpc::ServerWriteReactor<v1::CampaignStatus>* Watch(Context*,
                                                      const v1::CampaignRequest*) override;
  grpc::ServerWriteReactor<v1::Changes>* WatchChanges(Context*,
                                                      const v1::WatchChangesRequest*) override;
  Unary* GetPosterior(Context*, const v1::PosteriorRequest*, v1::Posterior*) override;
  grpc::ServerWriteReactor<v1::Sample>* GetSamples(Context*, const v1::CampaignRequest*) override;
  grpc::ServerWriteReactor<v1::SampleStates>* GetStates(Context*,
                                                        const v1::StatesRequest*) override;
  Unary* GetSource(Context*, const v1::CampaignRequest*, v1::CampaignSource*) override;
  grpc::ServerWriteReactor<v1::BlobChunk>* GetBlob(Context*, const v1::BlobByDigest*) override;
  grpc::ServerWriteReactor<v1::LogEntry>* GetLog(Context*, const v1::CampaignRequest*) override;
  Unary* AddFinding(Context*, const v1::AddFindingRequest*, v1::Finding*) override;
  Unary* ListFindings(Context*, const v1::CampaignRequest*, v1::FindingList*) override;
  Unary* Pause(Context*, const v1::ControlRequest*, v1::CampaignStatus*) override;
  Unary* Resume(Context*, const v1::ControlRequest*, v1::CampaignStatus*) override;
  Unary* Cancel(Context*, const v1::ControlRequest*, v1::CampaignStatus*) override;
  Unary* SetPriority(Context*, const v1::PriorityRequest*, v1::CampaignStatus*) override;
  Unary* SetQuota(Context*, const v1::QuotaRequest*, v1::OwnerShare*) override;
  Unary* ListShares(Context*, const v1::SharesRequest*, v1::ShareList*) override;
  Unary* Delete(Context*, const v1::ControlRequest*, v1::DeleteReply*) override;
  Unary* ListWorkers(Context*, const v1::ListWorkersRequest*, v1::WorkerList*) override;
  Unary* DrainWorker(Context*, const v1::DrainRequest*, v1::WorkerInfo*) override;
  Unary* Examine(Context*, const v1::ExamineRequest*, v1::ServerReport*) override;
  Unary* GetMetrics(Context*, const v1::MetricsRequest*, v1::Metrics*) override;
  grpc::ServerWriteReactor<v1::BlobChunk>* Backup(Context*, const v1::BackupRequest*) override;
  Unary* Prune(Context*, const v1::PruneRequest*, v1::PruneReply*) override;

 private:
  using Act = std::function<void(std::int64_t campaign, const store::Store::Job& also,
                                 const scheduler::Scheduler::Reply& reply)>;

  /// A call that goes on where it is let in (calls.h), and else ends there.
  Unary* Enter(Context* context, Right right, const google::protobuf::Message& request,
               const std::function<void(Unary*, const Caller&)>& go_on);
  /// The same of a call that is answered with a stream, made by `go_on` from its entry.
  template <typename Message>
  grpc::ServerWriteReactor<Message>* EnterStream(
      Context* context, const google::protobuf::Message& request,
      const std::function<grpc::ServerWriteReactor<Message>*(Entry)>& go_on);
  /// Streams what `load` reads of a campaign.
  template <typename Message>
  grpc::ServerWriteReactor<Message>* Stream(
      Context* context, const v1::CampaignRequest& request,
      absl::StatusOr<std::vector<Message>> (*load)(store::Reader&, std::int64_t));
  /// A question that the store alone answers.
  template <typename Request, typename Reply>
  Unary* Ask(Context* context, const Request* request, Reply* reply,
             std::function<absl::StatusOr<Reply>(store::Reader&)> answer);
  /// On the strand: stores a campaign that was checked, once per request, and ends the call.
  void Keep(store::NewCampaign accepted, const v1::SubmitRequest& request, const Caller& caller,
            Unary* reactor, v1::SubmitReply* reply);
  /// Status of a campaign, live parts included, then the end of the call.
  void FinishWithStatus(Unary* reactor, std::int64_t campaign, v1::CampaignStatus* reply);
  /// On the strand: a change of one campaign, once per request_id. done gets its outcome.
  void Control(const std::string& verb, const Caller& caller, const v1::ControlRequest& request,
               const Act& act, std::function<void(const absl::StatusOr<std::int64_t>&)> done);
  /// Guard::MayChange(); a refusal is logged.
  absl::Status MayChange(const Caller& caller, const std::string& campaign,
                         const std::string& owner);
  /// On the strand: what AddFinding() is to store, if it may.
  absl::StatusOr<NewFinding> FindingToKeep(const v1::AddFindingRequest& request,
                                           const Caller& caller);
  /// On the strand: what AddRuns() is to add, if it may.
  absl::StatusOr<planning::NewRuns> RunsToAdd(const v1::AddRunsRequest& request,
                                              const Caller& caller);
  /// What is to be done with a campaign: its request_id is that of this verb and campaign.
  struct Wish {
    std::string verb;                          ///< with what it says besides
    const google::protobuf::Message& request;  ///< as it came
    v1::ControlRequest about;
  };
  Unary* ControlWithStatus(Context* context, const Wish& wish, v1::CampaignStatus* reply,
                           const Act& act);

  FinishedStatuses finished_;
  Descent descent_;
  Core& core_;
  const Site site_;
  ToldExperiments told_;
  Requests requests_;  // the strand's
  std::atomic<bool> backs_up_ = false;
  std::atomic<int> read_now_ = 0;  // submissions that are read, or wait to be
};

}  // namespace calib::service
