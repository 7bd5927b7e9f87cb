#include "server/service/campaigns_service.h"

#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/status.h"
#include "server/service/blob_stream.h"
#include "server/service/calls.h"
#include "server/service/queries.h"
#include "server/service/stream_reactor.h"
#include "server/service/watch.h"
#include "server/service/watch_changes.h"

namespace calib::service {
grpc::ServerUnaryReactor* CampaignsService::Enter(
    Context* context, Right right, const google::protobuf::Message& request,
    const std::function<void(Unary*, const Caller&)>& go_on) {
  auto entry = Admit(core_, *context, right, &request);
  if (!entry.ok()) {
    return new EndedCall<Unary>(entry.status());
  }
  auto* call = new UnaryCall(std::move(entry->pass));
  go_on(call, entry->caller);
  return call;
}

template <typename Message>
grpc::ServerWriteReactor<Message>* CampaignsService::EnterStream(
    Context* context, const google::protobuf::Message& request,
    const std::function<grpc::ServerWriteReactor<Message>*(Entry)>& go_on) {
  auto entry = Admit(core_, *context, Right::kRead, &request);
  if (!entry.ok()) {
    return new EndedCall<grpc::ServerWriteReactor<Message>>(entry.status());
  }
  return go_on(*std::move(entry));
}

template <typename Message>
grpc::ServerWriteReactor<Message>* CampaignsService::Stream(
    Context* context, const v1::CampaignRequest& request,
    absl::StatusOr<std::vector<Message>> (*load)(store::Reader&, std::int64_t)) {
  return EnterStream<Message>(context, request, [&](Entry entry) {
    return new StreamReactor<Message>(
        core_, std::move(entry.pass), &Core::Tell,
        AtOnce<Message>(
            [this, campaign = request.campaign(), load]() -> absl::StatusOr<std::vector<Message>> {
              ASSIGN_OR_RETURN(const auto id, ParseCampaign(campaign));
              ASSIGN_OR_RETURN(auto reader, core_.Read());
              return load(reader, id);
            }));
  });
}

// ---- questions ----

template <typename Request, typename Reply>
grpc::ServerUnaryReactor* CampaignsService::Ask(
    Context* context, const Request* request, Reply* reply,
    std::function<absl::StatusOr<Reply>(store::Reader&)> answer) {
  return Enter(context, Right::kRead, *request,
               [this, reply, answer = std::move(answer)](Unary* reactor, const Caller&) {
                 core_.Tell([this, reactor, reply, answer] {
                   auto reader = core_.Read();
                   Answer(reactor,
                          reader.ok() ? answer(*reader) : absl::StatusOr<Reply>(reader.status()),
                          reply);
                 });
               });
}

void CampaignsService::FinishWithStatus(Unary* reactor, std::int64_t campaign,
                                        v1::CampaignStatus* reply) {
  core_.Query([this, reactor, campaign, reply, live = core_.scheduler().Live(campaign),
               waits = core_.WaitsFor()] {
    auto reader = core_.Read();
    Answer(reactor,
           reader.ok() ? StatusOf(*reader, campaign, live, waits, &finished_)
                       : absl::StatusOr<v1::CampaignStatus>(reader.status()),
           reply);
  });
}

grpc::ServerUnaryReactor* CampaignsService::Show(Context* context,
                                                 const v1::CampaignRequest* request,
                                                 v1::CampaignStatus* reply) {
  return Enter(
      context, Right::kRead, *request, [this, request, reply](Unary* reactor, const Caller&) {
        const auto id = ParseCampaign(request->campaign());
        if (!id.ok()) {
          reactor->Finish(rpc::ToGrpc(id.status()));
          return;
        }
        core_.Post([this, reactor, reply, id = *id] { FinishWithStatus(reactor, id, reply); });
      });
}

grpc::ServerUnaryReactor* CampaignsService::List(Context* context, const v1::ListRequest* request,
                                                 v1::ListReply* reply) {
  return Enter(context, Right::kRead, *request,
               [this, request, reply](Unary* reactor, const Caller&) {
                 core_.Post([this, reactor, request, reply] {
                   core_.Tell([this, reactor, request, reply, live = core_.scheduler().AllLive(),
                               waits = core_.WaitsFor()] {
                     const auto list = [&]() -> absl::StatusOr<v1::ListReply> {
                       ASSIGN_OR_RETURN(auto reader, core_.Read());
                       ASSIGN_OR_RETURN(const auto campaigns, Asked(reader, *request, descent_));
                       return ListOf(reader, campaigns, live, waits, &finished_);
                     };
                     Answer(reactor, list(), reply);
                   });
                 });
               });
}

grpc::ServerUnaryReactor* CampaignsService::GetPosterior(Context* context,
                                                         const v1::PosteriorRequest* request,
                                                         v1::Posterior* reply) {
  return Ask<v1::PosteriorRequest, v1::Posterior>(
      context, request, reply, [request](store::Reader& reader) -> absl::StatusOr<v1::Posterior> {
        ASSIGN_OR_RETURN(const auto id, ParseCampaign(request->campaign()));
        std::optional<int> iteration;
        if (request->has_iteration()) {
          iteration = request->iteration();
        }
        return PosteriorOf(reader, id, iteration);
      });
}

grpc::ServerUnaryReactor* CampaignsService::GetSource(Context* context,
                                                      const v1::CampaignRequest* request,
                                                      v1::CampaignSource* reply) {
  return Ask<v1::CampaignRequest, v1::CampaignSource>(
      context, request, reply,
      [request](store::Reader& reader) -> absl::StatusOr<v1::CampaignSource> {
        const auto id = ParseCampaign(request->campaign());
        return id.ok() ? SourceOf(reader, *id) : absl::StatusOr<v1::CampaignSource>(id.status());
      });
}

grpc::ServerWriteReactor<v1::CampaignStatus>* CampaignsService::Watch(
    Context* context, const v1::CampaignRequest* request) {
  return EnterStream<v1::CampaignStatus>(context, *request, [this, request](Entry entry) {
    return WatchCampaign(core_, std::move(entry), request->campaign());
  });
}

grpc::ServerWriteReactor<v1::Changes>* CampaignsService::WatchChanges(
    Context* context, const v1::WatchChangesRequest* request) {
  return EnterStream<v1::Changes>(context, *request, [this](Entry entry) {
    return service::WatchChanges(core_, std::move(entry));
  });
}

grpc::ServerWriteReactor<v1::Sample>* CampaignsService::GetSamples(
    Context* context, const v1::CampaignRequest* request) {
  return Stream<v1::Sample>(context, *request, SamplesOf);
}

grpc::ServerWriteReactor<v1::SampleStates>* CampaignsService::GetStates(
    Context* context, const v1::StatesRequest* request) {
  return EnterStream<v1::SampleStates>(context, *request, [this, request](Entry entry) {
    auto pieces = std::make_shared<StatePieces>(
        told_, request->campaign(),
        request->has_sample() ? std::optional<int>(request->sample()) : std::nullopt);
    return new StreamReactor<v1::SampleStates>(
        core_, std::move(entry.pass), &Core::Parse,
        [this, pieces]() -> absl::StatusOr<std::vector<v1::SampleStates>> {
          ASSIGN_OR_RETURN(auto reader, core_.Read());
          return pieces->Next(reader);
        });
  });
}

grpc::ServerWriteReactor<v1::LogEntry>* CampaignsService::GetLog(
    Context* context, const v1::CampaignRequest* request) {
  return Stream<v1::LogEntry>(context, *request, LogOf);
}

grpc::ServerUnaryReactor* CampaignsService::ListFindings(Context* context,
                                                         const v1::CampaignRequest* request,
                                                         v1::FindingList* reply) {
  return Ask<v1::CampaignRequest, v1::FindingList>(
      context, request, reply, [request](store::Reader& reader) -> absl::StatusOr<v1::FindingList> {
        const auto id = ParseCampaign(request->campaign());
        return id.ok() ? FindingsOf(reader, *id) : absl::StatusOr<v1::FindingList>(id.status());
      });
}

// ---- contents ----

grpc::ServerReadReactor<v1::BlobChunk>* CampaignsService::PutBlob(Context* context,
                                                                  v1::BlobReceipt* reply) {
  return ReceiveBlob(core_, *context, Right::kChange, site_.state_folder, reply);
}

grpc::ServerWriteReactor<v1::BlobChunk>* CampaignsService::GetBlob(
    Context* context, const v1::BlobByDigest* request) {
  return SendBlob(core_, *context, Right::kRead, *request, request->digest());
}

// ---- workers ----

grpc::ServerUnaryReactor* CampaignsService::ListWorkers(Context* context,
                                                        const v1::ListWorkersRequest* request,
                                                        v1::WorkerList* reply) {
  return Enter(context, Right::kRead, *request, [this, reply](Unary* reactor, const Caller&) {
    core_.Post([this, reply, reactor] {
      v1::WorkerList list;
      for (v1::WorkerInfo& worker : core_.scheduler().Workers()) {
        *list.add_workers() = std::move(worker);
      }
      core_.Tell([reactor, reply, list = std::move(list)]() mutable {
        Answer(reactor, absl::StatusOr<v1::WorkerList>(std::move(list)), reply);
      });
    });
  });
}

grpc::ServerUnaryReactor* CampaignsService::DrainWorker(Context* context,
                                                        const v1::DrainRequest* request,
                                                        v1::WorkerInfo* reply) {
  return Enter(context, Right::kOperate, *request,
               [this, request, reply](Unary* reactor, const Caller& caller) {
                 core_.Post([this, request, reply, reactor, caller] {
                   auto worker = core_.scheduler().Drain(
                       request->worker(), std::chrono::milliseconds(request->within_ms()));
                   if (worker.ok()) {
                     LogChange("drain", request->worker(), caller);
                   }
                   Answer(reactor, std::move(worker), reply);
                 });
               });
}

}  // namespace calib::service
