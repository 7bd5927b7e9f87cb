#include "server/service/campaigns_service.h"

#include <chrono>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/status.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/folder_report.h"
#include "server/service/blob_stream.h"
#include "server/service/queries.h"
#include "server/service/stream_reactor.h"
#include "server/service/submission.h"
#include "server/service/watch.h"

namespace calib::service {
namespace {

constexpr std::chrono::seconds kLookingThroughTheFile{10};

/// Streams what `load` reads of a campaign.
template <typename Message, typename Load>
grpc::ServerWriteReactor<Message>* Stream(Core& core, const std::string& campaign, Load load) {
  return new StreamReactor<Message>(
      core, [&core, campaign, load]() -> absl::StatusOr<std::vector<Message>> {
        ASSIGN_OR_RETURN(const auto id, ParseCampaign(campaign));
        ASSIGN_OR_RETURN(auto reader, core.Read());
        return load(reader, id);
      });
}

}  // namespace

// ---- questions ----

template <typename Reply>
grpc::ServerUnaryReactor* CampaignsService::Ask(
    Context* context, Reply* reply, std::function<absl::StatusOr<Reply>(store::Reader&)> answer) {
  Unary* reactor = context->DefaultReactor();
  core_.Query([this, reactor, reply, answer = std::move(answer)] {
    auto reader = core_.Read();
    auto answered = reader.ok() ? answer(*reader) : absl::StatusOr<Reply>(reader.status());
    if (answered.ok()) {
      *reply = *std::move(answered);
    }
    reactor->Finish(rpc::ToGrpc(answered.status()));
  });
  return reactor;
}

void CampaignsService::FinishWithStatus(Unary* reactor, std::int64_t campaign,
                                        v1::CampaignStatus* reply) {
  core_.Query([this, reactor, campaign, reply, live = core_.scheduler().Live(campaign)] {
    auto reader = core_.Read();
    auto status = reader.ok() ? StatusOf(*reader, campaign, live)
                              : absl::StatusOr<v1::CampaignStatus>(reader.status());
    if (status.ok()) {
      *reply = *std::move(status);
    }
    reactor->Finish(rpc::ToGrpc(status.status()));
  });
}

grpc::ServerUnaryReactor* CampaignsService::Show(Context* context,
                                                 const v1::CampaignRequest* request,
                                                 v1::CampaignStatus* reply) {
  Unary* reactor = context->DefaultReactor();
  const auto id = ParseCampaign(request->campaign());
  if (!id.ok()) {
    reactor->Finish(rpc::ToGrpc(id.status()));
    return reactor;
  }
  core_.Post([this, reactor, reply, id = *id] { FinishWithStatus(reactor, id, reply); });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::List(Context* context,
                                                 const v1::ListRequest* /*request*/,
                                                 v1::ListReply* reply) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, reactor, reply] {
    core_.Query([this, reactor, reply, live = core_.scheduler().AllLive()] {
      auto reader = core_.Read();
      auto list =
          reader.ok() ? ListOf(*reader, live) : absl::StatusOr<v1::ListReply>(reader.status());
      if (list.ok()) {
        *reply = *std::move(list);
      }
      reactor->Finish(rpc::ToGrpc(list.status()));
    });
  });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::GetPosterior(Context* context,
                                                         const v1::PosteriorRequest* request,
                                                         v1::Posterior* reply) {
  return Ask<v1::Posterior>(context, reply,
                            [request](store::Reader& reader) -> absl::StatusOr<v1::Posterior> {
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
  return Ask<v1::CampaignSource>(
      context, reply, [request](store::Reader& reader) -> absl::StatusOr<v1::CampaignSource> {
        const auto id = ParseCampaign(request->campaign());
        return id.ok() ? SourceOf(reader, *id) : absl::StatusOr<v1::CampaignSource>(id.status());
      });
}

grpc::ServerWriteReactor<v1::CampaignStatus>* CampaignsService::Watch(
    Context* /*context*/, const v1::CampaignRequest* request) {
  return WatchCampaign(core_, request->campaign());
}

grpc::ServerWriteReactor<v1::Sample>* CampaignsService::GetSamples(
    Context* /*context*/, const v1::CampaignRequest* request) {
  return Stream<v1::Sample>(core_, request->campaign(), SamplesOf);
}

grpc::ServerWriteReactor<v1::SampleStates>* CampaignsService::GetStates(
    Context* /*context*/, const v1::StatesRequest* request) {
  std::optional<int> sample;
  if (request->has_sample()) {
    sample = request->sample();
  }
  return Stream<v1::SampleStates>(core_, request->campaign(),
                                  [sample](store::Reader& reader, std::int64_t campaign) {
                                    return StatesOf(reader, campaign, sample);
                                  });
}

grpc::ServerWriteReactor<v1::LogEntry>* CampaignsService::GetLog(
    Context* /*context*/, const v1::CampaignRequest* request) {
  return Stream<v1::LogEntry>(core_, request->campaign(), LogOf);
}

grpc::ServerUnaryReactor* CampaignsService::ListFindings(Context* context,
                                                         const v1::CampaignRequest* request,
                                                         v1::FindingList* reply) {
  return Ask<v1::FindingList>(
      context, reply, [request](store::Reader& reader) -> absl::StatusOr<v1::FindingList> {
        const auto id = ParseCampaign(request->campaign());
        return id.ok() ? FindingsOf(reader, *id) : absl::StatusOr<v1::FindingList>(id.status());
      });
}

// ---- contents ----

grpc::ServerReadReactor<v1::BlobChunk>* CampaignsService::PutBlob(Context* /*context*/,
                                                                  v1::BlobReceipt* reply) {
  return ReceiveBlob(core_, reply);
}

grpc::ServerWriteReactor<v1::BlobChunk>* CampaignsService::GetBlob(
    Context* /*context*/, const v1::BlobByDigest* request) {
  return SendBlob(core_, request->digest());
}

// ---- changes ----

grpc::ServerUnaryReactor* CampaignsService::Submit(Context* context,
                                                   const v1::SubmitRequest* request,
                                                   v1::SubmitReply* reply) {
  Unary* reactor = context->DefaultReactor();
  const auto finish = [reactor](const absl::Status& status) {
    reactor->Finish(rpc::ToGrpc(status));
  };
  core_.Query([this, request, reply, finish] {
    auto reader = core_.Read();
    auto checked = reader.ok() ? CheckSubmission(*request, *reader) : reader.status();
    if (!checked.ok()) {
      finish(checked.status());
      return;
    }
    if (auto* problems = std::get_if<v1::SubmitReply>(&*checked); problems != nullptr) {
      *reply = std::move(*problems);
      finish(absl::OkStatus());
      return;
    }
    core_.Post([this, request, reply, finish,
                accepted = std::get<store::NewCampaign>(*std::move(checked))]() mutable {
      if (!core_.health().ok()) {
        finish(core_.health());
        return;
      }
      auto latest = core_.Read();
      const store::RequestRecord record{.digest = ContentDigest(*request)};
      const auto before = latest.ok()
                              ? requests_.Begin(request->request_id(), record.digest, *latest)
                              : absl::StatusOr<std::optional<std::string>>(latest.status());
      if (!before.ok() || before->has_value()) {
        if (before.ok()) {
          reply->set_campaign(**before);
        }
        finish(before.status());
        return;
      }
      accepted.created_unix_ms = core_.UnixMs();
      core_.scheduler().Submit(
          std::move(accepted), {request->files().begin(), request->files().end()},
          request->request_id(), record,
          [this, reply, finish,
           id = request->request_id()](const absl::StatusOr<std::string>& campaign) {
            requests_.Done(id);
            if (campaign.ok()) {
              reply->set_campaign(*campaign);
            }
            finish(campaign.status());
          });
    });
  });
  return reactor;
}

void CampaignsService::Control(const std::string& verb, const v1::ControlRequest& request,
                               const Act& act,
                               std::function<void(const absl::StatusOr<std::int64_t>&)> done) {
  if (!core_.health().ok()) {
    done(core_.health());
    return;
  }
  const auto campaign = ParseCampaign(request.campaign());
  auto reader = core_.Read();
  for (const absl::Status& status : {campaign.status(), reader.status()}) {
    if (!status.ok()) {
      done(status);
      return;
    }
  }
  const std::string digest = absl::StrCat(verb, " ", request.campaign());
  const auto before = requests_.Begin(request.request_id(), digest, *reader);
  if (!before.ok() || before->has_value()) {
    done(before.ok() ? campaign : absl::StatusOr<std::int64_t>(before.status()));
    return;
  }
  const auto finish = [this, id = request.request_id(), campaign,
                       done = std::move(done)](const absl::Status& status) {
    requests_.Done(id);
    done(status.ok() ? campaign : absl::StatusOr<std::int64_t>(status));
  };
  if (const auto record = reader->Campaign(*campaign); !record.ok()) {
    finish(record.status());
    return;
  }
  store::Store::Job remember;
  if (!request.request_id().empty()) {
    remember = [id = request.request_id(), digest](store::Transaction& transaction) {
      transaction.PutRequest(id, {.digest = digest});
    };
  }
  act(*campaign, remember, finish);
}

grpc::ServerUnaryReactor* CampaignsService::ControlWithStatus(Context* context,
                                                              const std::string& verb,
                                                              const v1::ControlRequest* request,
                                                              v1::CampaignStatus* reply,
                                                              const Act& act) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, verb, request, reply, act, reactor] {
    Control(verb, *request, act,
            [this, reactor, reply](const absl::StatusOr<std::int64_t>& campaign) {
              if (campaign.ok()) {
                FinishWithStatus(reactor, *campaign, reply);
              } else {
                reactor->Finish(rpc::ToGrpc(campaign.status()));
              }
            });
  });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::Pause(Context* context,
                                                  const v1::ControlRequest* request,
                                                  v1::CampaignStatus* reply) {
  return ControlWithStatus(context, "pause", request, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Pause(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::Resume(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::CampaignStatus* reply) {
  return ControlWithStatus(context, "resume", request, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Resume(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::Cancel(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::CampaignStatus* reply) {
  return ControlWithStatus(context, "cancel", request, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Cancel(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::Delete(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::DeleteReply* /*reply*/) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, request, reactor] {
    Control(
        "delete", *request,
        [this](std::int64_t campaign, const auto& also, const auto& done) {
          core_.scheduler().Delete(campaign, also, done);
        },
        [reactor](const absl::StatusOr<std::int64_t>& campaign) {
          reactor->Finish(rpc::ToGrpc(campaign.status()));
        });
  });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::AddFinding(Context* context,
                                                       const v1::AddFindingRequest* request,
                                                       v1::Finding* reply) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, request, reply, reactor] {
    auto reader = core_.Read();
    const auto finding = !core_.health().ok() ? core_.health()
                         : reader.ok()        ? CheckFinding(*request, core_.UnixMs(), *reader)
                                              : absl::StatusOr<NewFinding>(reader.status());
    if (!finding.ok()) {
      reactor->Finish(rpc::ToGrpc(finding.status()));
      return;
    }
    reply->set_kind(finding->record.kind);
    reply->set_digest(finding->record.digest);
    reply->set_created_unix_ms(finding->record.created_unix_ms);
    core_.Write(
        [finding = *finding](store::Transaction& transaction) {
          transaction.PutFinding(finding.campaign, finding.record);
        },
        [reactor](const absl::Status& status) { reactor->Finish(rpc::ToGrpc(status)); });
  });
  return reactor;
}

// ---- workers ----

grpc::ServerUnaryReactor* CampaignsService::ListWorkers(Context* context,
                                                        const v1::ListWorkersRequest* /*request*/,
                                                        v1::WorkerList* reply) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, reply, reactor] {
    for (v1::WorkerInfo& worker : core_.scheduler().Workers()) {
      *reply->add_workers() = std::move(worker);
    }
    reactor->Finish(grpc::Status::OK);
  });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::DrainWorker(Context* context,
                                                        const v1::DrainRequest* request,
                                                        v1::WorkerInfo* reply) {
  Unary* reactor = context->DefaultReactor();
  core_.Post([this, request, reply, reactor] {
    auto worker = core_.scheduler().Drain(request->worker());
    if (worker.ok()) {
      *reply = *std::move(worker);
    }
    reactor->Finish(rpc::ToGrpc(worker.status()));
  });
  return reactor;
}

grpc::ServerUnaryReactor* CampaignsService::Examine(Context* context,
                                                    const v1::ExamineRequest* /*request*/,
                                                    v1::ServerReport* reply) {
  Unary* reactor = context->DefaultReactor();
  reply->set_unix_ms(core_.UnixMs());
  core_.Post([this, reply, reactor] {
    for (v1::RefusedWorker& worker : core_.scheduler().Refused()) {
      *reply->add_refused() = std::move(worker);
    }
    core_.Query([this, reply, reactor] {
      reply->set_engine_version(dem::EngineVersion());
      reply->set_catalog_digest(campaign::Sha256Hex(dem::CatalogText()));
      reply->set_listen(site_.listen);
      *reply->mutable_state_folder() = messages::ExamineFolder(site_.state_folder);
      auto reader = core_.Read();
      const auto check = reader.ok() ? reader->CheckFile(kLookingThroughTheFile)
                                     : absl::StatusOr<store::Reader::FileCheck>(reader.status());
      reply->set_database(check.ok() ? check->fault : std::string(check.status().message()));
      reply->set_database_in_full(check.ok() && check->in_full);
      reactor->Finish(grpc::Status::OK);
    });
  });
  return reactor;
}

}  // namespace calib::service
