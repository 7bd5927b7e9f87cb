// The Campaigns rpcs of who keeps a server well: what it stands on and how it fares.

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/chunking.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/folder_report.h"
#include "server/service/calls.h"
#include "server/service/campaigns_service.h"
#include "server/service/stream_reactor.h"
#include "server/service/upkeep/backup.h"

namespace calib::service {
namespace {

constexpr std::chrono::seconds kLookingThroughTheFile{10};
/// That are counted at a time.
constexpr int kMostContents = 1'000'000;

/// The certificate in a folder as it is by now, and why it cannot be used.
void TellCertificate(const std::string& folder, std::int64_t now_unix_s, v1::ServerReport& report) {
  const auto credentials = access::ReadCredentials(folder);
  const absl::Status usable =
      credentials.ok() ? access::CheckOwn(*credentials, now_unix_s) : credentials.status();
  report.set_certificate_problem(std::string(usable.message()));
  if (credentials.ok()) {
    report.set_certificate(credentials->holder.name);
    report.set_certificate_end_unix_s(
        std::max<std::int64_t>(0, credentials->holder.not_after_unix_s));
  }
}

/// How large the state is, what is to be tidied, and when it was backed up.
void TellUpkeep(store::Reader& reader, v1::ServerReport& report) {
  if (const auto upkeep = reader.UpkeepOf(); upkeep.ok()) {
    report.set_leaving(upkeep->leaving);
    report.set_database_free_bytes(upkeep->empty_bytes);
  }
  if (const auto last = reader.LastBackupUnixMs(); last.ok()) {
    report.set_last_backup_unix_ms(*last);
  }
}

}  // namespace

grpc::ServerUnaryReactor* CampaignsService::Examine(Context* context,
                                                    const v1::ExamineRequest* request,
                                                    v1::ServerReport* reply) {
  return Enter(context, Right::kRead, *request, [this, reply](Unary* reactor, const Caller&) {
    v1::ServerReport report;
    report.set_unix_ms(core_.UnixMs());
    core_.Post([this, reply, reactor, report = std::move(report)]() mutable {
      report.set_waits(core_.WaitsFor());
      const store::StoreNumbers numbers = core_.Measure().store;
      report.set_database_bytes(numbers.file_bytes);
      report.set_wal_bytes(numbers.wal_bytes);
      for (v1::RefusedWorker& worker : core_.scheduler().Refused()) {
        *report.add_refused() = std::move(worker);
      }
      core_.Tell([this, reply, reactor, report = std::move(report)]() mutable {
        report.set_engine_version(dem::EngineVersion());
        report.set_catalog_digest(campaign::Sha256Hex(dem::CatalogText()));
        report.set_listen(site_.listen);
        if (!site_.tls.empty()) {
          TellCertificate(site_.tls, report.unix_ms() / 1000, report);
        }
        *report.mutable_state_folder() = messages::ExamineFolder(site_.state_folder);
        auto reader = core_.Read();
        const auto check = reader.ok() ? reader->CheckFile(kLookingThroughTheFile)
                                       : absl::StatusOr<store::Reader::FileCheck>(reader.status());
        report.set_database(check.ok() ? check->fault : std::string(check.status().message()));
        report.set_database_in_full(check.ok() && check->in_full);
        if (reader.ok()) {
          TellUpkeep(*reader, report);
        }
        Answer(reactor, absl::StatusOr<v1::ServerReport>(std::move(report)), reply);
      });
    });
  });
}

grpc::ServerUnaryReactor* CampaignsService::GetMetrics(Context* context,
                                                       const v1::MetricsRequest* request,
                                                       v1::Metrics* reply) {
  return Enter(context, Right::kRead, *request, [this, reply](Unary* reactor, const Caller&) {
    core_.Post([this, reply, reactor] {
      core_.Query(
          [reply, reactor, measured = core_.Measure(), why = core_.WhyNotStore().message()] {
            v1::Metrics metrics;
            metrics.set_text(MetricsText(measured));
            metrics.set_not_ready(std::string(why));
            Answer(reactor, absl::StatusOr<v1::Metrics>(std::move(metrics)), reply);
          });
    });
  });
}

grpc::ServerWriteReactor<v1::BlobChunk>* CampaignsService::Backup(
    Context* context, const v1::BackupRequest* request) {
  using Reactor = grpc::ServerWriteReactor<v1::BlobChunk>;
  auto entry = AdmitWithBlob(core_, *context, Right::kOperate, request);
  if (!entry.ok()) {
    return new EndedCall<Reactor>(entry.status());
  }
  if (backs_up_.exchange(true)) {
    return new EndedCall<Reactor>(absl::ResourceExhaustedError(
        "a backup is being taken already: try again when it has ended"));
  }
  struct UnderWay {
    explicit UnderWay(std::atomic<bool>& flag) : backs_up(flag) {}
    ~UnderWay() { backs_up = false; }
    std::atomic<bool>& backs_up;
    std::unique_ptr<BackupCopy> copy{};
    bool all_sent = false;
  };
  auto under_way = std::make_shared<UnderWay>(backs_up_);
  return new StreamReactor<v1::BlobChunk>(
      core_, std::move(entry->pass), &Core::LookAfter,
      [this, under_way, context,
       caller = entry->caller]() -> absl::StatusOr<std::vector<v1::BlobChunk>> {
        std::vector<v1::BlobChunk> chunks;
        if (under_way->all_sent) return chunks;
        auto& copy = under_way->copy;
        if (copy == nullptr) {
          ASSIGN_OR_RETURN(auto reader, core_.Read());
          ASSIGN_OR_RETURN(copy, BackupCopy::Make(reader, site_.state_folder, [this, context] {
                             return !core_.ends() && !context->IsCancelled();
                           }));
          chunks.emplace_back().set_digest(copy->digest());
        } else {
          chunks.emplace_back();
        }
        ASSIGN_OR_RETURN(std::string piece, copy->Next(rpc::kChunkBytes));
        if (piece.empty()) {
          under_way->all_sent = true;
          LogChange("backup", "state", caller);
          core_.Post([this, now = core_.UnixMs()] {
            core_.WriteIfRoom([now](store::Transaction& t) { t.LogBackup(now); },
                              [](const absl::Status&) {});
          });
          return std::vector<v1::BlobChunk>();
        }
        chunks.back().set_data(std::move(piece));
        return chunks;
      });
}

grpc::ServerUnaryReactor* CampaignsService::Prune(Context* context, const v1::PruneRequest* request,
                                                  v1::PruneReply* reply) {
  return Enter(context, Right::kOperate, *request,
               [this, request, reply](Unary* reactor, const Caller& caller) {
                 core_.LookAfter([this, request, reply, reactor, caller] {
                   auto told = std::make_shared<v1::PruneReply>();
                   std::vector<std::int64_t> over;
                   const auto look = [&]() -> absl::Status {
                     ASSIGN_OR_RETURN(auto reader, core_.Read());
                     ASSIGN_OR_RETURN(const auto contents,
                                      reader.Unnamed(core_.tidying().PutBefore(), kMostContents));
                     told->set_contents(static_cast<std::int64_t>(contents.size()));
                     if (!request->has_keep_states()) return absl::OkStatus();
                     ASSIGN_OR_RETURN(const auto campaigns, reader.Campaigns());
                     for (const store::CampaignRecord& record : campaigns) {
                       if (campaign::IsOver(record.progress.state))
                         over.push_back(record.submitted.id);
                     }
                     return absl::OkStatus();
                   };
                   if (const absl::Status status = look(); !status.ok()) {
                     reactor->Finish(rpc::ToGrpc(status));
                     return;
                   }
                   core_.Post([this, reply, reactor, caller, told, over = std::move(over),
                               keep = request->keep_states()] {
                     if (const absl::Status why = core_.WhyNotStore(); !why.ok()) {
                       reactor->Finish(rpc::ToGrpc(why));
                       return;
                     }
                     core_.WriteIfRoom(
                         [told, over, keep](store::Transaction& t) {
                           std::int64_t pruned = 0;
                           for (const std::int64_t campaign : over)
                             pruned += t.Prune(campaign, keep);
                           told->set_campaigns(pruned);
                         },
                         [this, reply, reactor, caller, told](const absl::Status& status) {
                           if (status.ok()) {
                             LogChange("prune", "state", caller);
                             core_.tidying().Begin();
                           }
                           Answer(reactor,
                                  status.ok() ? absl::StatusOr<v1::PruneReply>(*told)
                                              : absl::StatusOr<v1::PruneReply>(status),
                                  reply);
                         });
                   });
                 });
               });
}

}  // namespace calib::service
