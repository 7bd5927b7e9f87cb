// The Campaigns rpcs that change something: each goes through the strand, once per request_id, and
// is made by who may (guard.h).

#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/status.h"
#include "server/service/calls.h"
#include "server/service/campaigns_service.h"
#include "server/service/queries.h"
#include "server/service/submission.h"

namespace calib::service {
namespace {

/// Campaigns that are read, or wait to be, at a time: each with its text, which may be a MiB.
constexpr int kMostRead = 16;

}  // namespace

grpc::ServerUnaryReactor* CampaignsService::Submit(Context* context,
                                                   const v1::SubmitRequest* request,
                                                   v1::SubmitReply* reply) {
  return Enter(context, Right::kChange, *request, [&](Unary* reactor, const Caller& caller) {
    if (read_now_.fetch_add(1) >= kMostRead) {
      --read_now_;
      reactor->Finish(rpc::ToGrpc(absl::ResourceExhaustedError(absl::StrCat(
          kMostRead, " campaigns are being read, and the server reads no more: try again later"))));
      return;
    }
    core_.Parse([this, request, reply, reactor, caller] {
      auto reader = core_.Read();
      auto checked =
          reader.ok() ? CheckSubmission(*request, core_.door().limits(), *reader) : reader.status();
      --read_now_;
      if (!checked.ok()) {
        reactor->Finish(rpc::ToGrpc(checked.status()));
      } else if (auto* problems = std::get_if<v1::SubmitReply>(&*checked); problems != nullptr) {
        Answer(reactor, absl::StatusOr<v1::SubmitReply>(std::move(*problems)), reply);
      } else {
        core_.Post([this, request, reply, reactor, caller,
                    accepted = std::get<store::NewCampaign>(*std::move(checked))]() mutable {
          accepted.owner = caller.name;
          Keep(std::move(accepted), *request, caller, reactor, reply);
        });
      }
    });
  });
}

void CampaignsService::Keep(store::NewCampaign accepted, const v1::SubmitRequest& request,
                            const Caller& caller, Unary* reactor, v1::SubmitReply* reply) {
  const auto finish = [reactor, reply](const absl::StatusOr<std::string>& campaign) {
    v1::SubmitReply kept;
    if (campaign.ok()) {
      kept.set_campaign(*campaign);
    }
    Answer(reactor,
           campaign.ok() ? absl::StatusOr<v1::SubmitReply>(std::move(kept))
                         : absl::StatusOr<v1::SubmitReply>(campaign.status()),
           reply);
  };
  const absl::Status why = core_.WhyNotStore();
  auto latest = core_.Read();
  for (const absl::Status& status : {why, latest.status()}) {
    if (!status.ok()) {
      finish(status);
      return;
    }
  }
  const store::RequestRecord record{.digest = ContentDigest(request)};
  const std::string key = RequestKey(caller, request.request_id());
  const auto before = requests_.Begin(key, record.digest, *latest);
  if (!before.ok() || before->has_value()) {
    finish(before.ok() ? absl::StatusOr<std::string>(**before)
                       : absl::StatusOr<std::string>(before.status()));
    return;
  }
  accepted.created_unix_ms = core_.UnixMs();
  core_.scheduler().Submit(
      std::move(accepted), {request.files().begin(), request.files().end()}, key, record,
      [this, finish, caller, key](const absl::StatusOr<std::string>& campaign) {
        requests_.Done(key);
        if (campaign.ok()) {
          LogChange("submit", *campaign, caller);
        }
        finish(campaign);
      });
}

absl::Status CampaignsService::MayChange(const Caller& caller, const std::string& campaign,
                                         const std::string& owner) {
  absl::Status status = Guard::MayChange(caller, campaign, owner);
  if (!status.ok()) {
    core_.door().LogRefusal(caller.peer, status);
  }
  return status;
}

void CampaignsService::Control(const std::string& verb, const Caller& caller,
                               const v1::ControlRequest& request, const Act& act,
                               std::function<void(const absl::StatusOr<std::int64_t>&)> done) {
  if (const absl::Status why = core_.WhyNotStore(); !why.ok()) {
    done(why);
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
  const std::string key = RequestKey(caller, request.request_id());
  const auto before = requests_.Begin(key, digest, *reader);
  if (!before.ok() || before->has_value()) {
    done(before.ok() ? campaign : absl::StatusOr<std::int64_t>(before.status()));
    return;
  }
  const auto finish = [this, verb, caller, key, campaign,
                       done = std::move(done)](const absl::Status& status) {
    requests_.Done(key);
    if (status.ok()) {
      LogChange(verb, absl::StrCat("c", *campaign), caller);
    }
    done(status.ok() ? campaign : absl::StatusOr<std::int64_t>(status));
  };
  const auto record = reader->Campaign(*campaign);
  if (const absl::Status status =
          record.ok() ? MayChange(caller, request.campaign(), record->submitted.owner)
                      : record.status();
      !status.ok()) {
    finish(status);
    return;
  }
  store::Store::Job remember;
  if (!key.empty()) {
    remember = [key, digest](store::Transaction& transaction) {
      transaction.PutRequest(key, {.digest = digest});
    };
  }
  act(*campaign, remember, finish);
}

grpc::ServerUnaryReactor* CampaignsService::ControlWithStatus(Context* context, const Wish& wish,
                                                              v1::CampaignStatus* reply,
                                                              const Act& act) {
  return Enter(context, Right::kChange, wish.request, [&](Unary* reactor, const Caller& caller) {
    core_.Post([this, verb = wish.verb, about = wish.about, reply, act, reactor, caller] {
      Control(verb, caller, about, act,
              [this, reactor, reply](const absl::StatusOr<std::int64_t>& campaign) {
                if (campaign.ok()) {
                  FinishWithStatus(reactor, *campaign, reply);
                } else {
                  reactor->Finish(rpc::ToGrpc(campaign.status()));
                }
              });
    });
  });
}

grpc::ServerUnaryReactor* CampaignsService::Pause(Context* context,
                                                  const v1::ControlRequest* request,
                                                  v1::CampaignStatus* reply) {
  return ControlWithStatus(context, {"pause", *request, *request}, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Pause(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::Resume(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::CampaignStatus* reply) {
  return ControlWithStatus(context, {"resume", *request, *request}, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Resume(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::Cancel(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::CampaignStatus* reply) {
  return ControlWithStatus(context, {"cancel", *request, *request}, reply,
                           [this](std::int64_t campaign, const auto& also, const auto& done) {
                             core_.scheduler().Cancel(campaign, also, done);
                           });
}

grpc::ServerUnaryReactor* CampaignsService::SetPriority(Context* context,
                                                        const v1::PriorityRequest* request,
                                                        v1::CampaignStatus* reply) {
  v1::ControlRequest about;
  about.set_campaign(request->campaign());
  about.set_request_id(request->request_id());
  return ControlWithStatus(
      context, {absl::StrCat("priority ", request->priority()), *request, about}, reply,
      [this, priority = request->priority()](std::int64_t campaign, const auto& also,
                                             const auto& done) {
        core_.scheduler().SetPriority({.campaign = campaign, .priority = priority}, also, done);
      });
}

grpc::ServerUnaryReactor* CampaignsService::SetQuota(Context* context,
                                                     const v1::QuotaRequest* request,
                                                     v1::OwnerShare* reply) {
  return Enter(
      context, Right::kOperate, *request,
      [this, request, reply](Unary* reactor, const Caller& caller) {
        core_.Post([this, request, reply, reactor, caller] {
          if (const absl::Status why = core_.WhyNotStore(); !why.ok()) {
            reactor->Finish(rpc::ToGrpc(why));
            return;
          }
          const std::optional<int> slots =
              request->has_slots() ? std::optional<int>(request->slots()) : std::nullopt;
          core_.scheduler().SetQuota(
              request->owner(), slots,
              [this, owner = request->owner(), reply, reactor, caller](const absl::Status& status) {
                if (!status.ok()) {
                  reactor->Finish(rpc::ToGrpc(status));
                  return;
                }
                LogChange("quota", owner, caller);
                v1::OwnerShare told;
                told.set_owner(owner);
                for (const v1::OwnerShare& share : core_.scheduler().OwnerShares()) {
                  if (share.owner() == owner) told = share;
                }
                Answer(reactor, absl::StatusOr<v1::OwnerShare>(std::move(told)), reply);
              });
        });
      });
}

grpc::ServerUnaryReactor* CampaignsService::ListShares(Context* context,
                                                       const v1::SharesRequest* request,
                                                       v1::ShareList* reply) {
  return Enter(context, Right::kRead, *request, [this, reply](Unary* reactor, const Caller&) {
    core_.Post([this, reply, reactor] {
      v1::ShareList list;
      for (v1::OwnerShare& share : core_.scheduler().OwnerShares()) {
        *list.add_shares() = std::move(share);
      }
      Answer(reactor, absl::StatusOr<v1::ShareList>(std::move(list)), reply);
    });
  });
}

grpc::ServerUnaryReactor* CampaignsService::Delete(Context* context,
                                                   const v1::ControlRequest* request,
                                                   v1::DeleteReply* /*reply*/) {
  return Enter(
      context, Right::kChange, *request, [this, request](Unary* reactor, const Caller& caller) {
        core_.Post([this, request, reactor, caller] {
          Control(
              "delete", caller, *request,
              [this](std::int64_t campaign, const auto& also, const auto& done) {
                core_.scheduler().Delete(campaign, also, [this, done](const absl::Status& status) {
                  done(status);
                  if (status.ok()) core_.tidying().Begin();
                });
              },
              [reactor](const absl::StatusOr<std::int64_t>& campaign) {
                reactor->Finish(rpc::ToGrpc(campaign.status()));
              });
        });
      });
}

absl::StatusOr<NewFinding> CampaignsService::FindingToKeep(const v1::AddFindingRequest& request,
                                                           const Caller& caller) {
  RETURN_IF_ERROR(core_.WhyNotStore());
  ASSIGN_OR_RETURN(auto reader, core_.Read());
  ASSIGN_OR_RETURN(auto finding, CheckFinding(request, core_.UnixMs(), reader));
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(finding.campaign));
  RETURN_IF_ERROR(MayChange(caller, request.campaign(), record.submitted.owner));
  return finding;
}

grpc::ServerUnaryReactor* CampaignsService::AddFinding(Context* context,
                                                       const v1::AddFindingRequest* request,
                                                       v1::Finding* reply) {
  return Enter(context, Right::kChange, *request,
               [this, request, reply](Unary* reactor, const Caller& caller) {
                 core_.Post([this, request, reply, reactor, caller] {
                   const auto finding = FindingToKeep(*request, caller);
                   if (!finding.ok()) {
                     reactor->Finish(rpc::ToGrpc(finding.status()));
                     return;
                   }
                   reply->set_kind(finding->record.kind);
                   reply->set_digest(finding->record.digest);
                   reply->set_created_unix_ms(finding->record.created_unix_ms);
                   core_.WriteIfRoom(
                       [finding = *finding](store::Transaction& transaction) {
                         transaction.PutFinding(finding.campaign, finding.record);
                       },
                       [this, reactor, caller, of = request->campaign(),
                        campaign = finding->campaign](const absl::Status& status) {
                         if (status.ok()) {
                           core_.scheduler().Concluded(campaign);
                           LogChange("finding", of, caller);
                         }
                         reactor->Finish(rpc::ToGrpc(status));
                       });
                 });
               });
}

absl::StatusOr<planning::NewRuns> CampaignsService::RunsToAdd(const v1::AddRunsRequest& request,
                                                              const Caller& caller) {
  RETURN_IF_ERROR(core_.WhyNotStore());
  ASSIGN_OR_RETURN(auto runs, CheckRuns(request));
  ASSIGN_OR_RETURN(auto reader, core_.Read());
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(runs.campaign));
  RETURN_IF_ERROR(MayChange(caller, request.campaign(), record.submitted.owner));
  RETURN_IF_ERROR(CheckHasStates(record));
  return runs;
}

grpc::ServerUnaryReactor* CampaignsService::AddRuns(Context* context,
                                                    const v1::AddRunsRequest* request,
                                                    v1::CampaignStatus* reply) {
  return Enter(context, Right::kChange, *request,
               [this, request, reply](Unary* reactor, const Caller& caller) {
                 core_.Post([this, request, reply, reactor, caller] {
                   const auto runs = RunsToAdd(*request, caller);
                   if (!runs.ok()) {
                     reactor->Finish(rpc::ToGrpc(runs.status()));
                     return;
                   }
                   core_.scheduler().AddRuns(
                       *runs, [this, reactor, reply, caller,
                               campaign = runs->campaign](const absl::StatusOr<bool>& added) {
                         if (!added.ok()) {
                           reactor->Finish(rpc::ToGrpc(added.status()));
                           return;
                         }
                         if (*added) {
                           LogChange("add_runs", absl::StrCat("c", campaign), caller);
                         }
                         FinishWithStatus(reactor, campaign, reply);
                       });
                 });
               });
}

}  // namespace calib::service
