#include "server/client/client.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "calib/v1/campaign.grpc.pb.h"
#include "proto/rpc/address.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/random_id.h"
#include "proto/rpc/shown_access.h"
#include "proto/rpc/status.h"
#include "server/client/interrupt.h"

namespace calib::client {
namespace {

constexpr std::chrono::milliseconds kConnect{1800};
constexpr std::chrono::minutes kLongestStream{10};
constexpr std::chrono::hours kLongestBackup{24};

/// A server that is slow to answer (a disk that stalls, a machine that sleeps) or is started again
/// is asked again, so that hours of a diagnosis do not end with one late answer. Every call may be
/// made twice: those that change something carry a request_id, a digest or the number of a batch.
constexpr int kCampaignsOfAPage = 500;  // some 200 KB
constexpr int kLateAnswers = 10;
constexpr int kLostConnections = 2;
constexpr std::chrono::minutes kReturn{1};       // of a server that was lost
constexpr std::chrono::milliseconds kLull{100};  // until a channel knows that it is broken

using Stub = v1::Campaigns::Stub;

struct Connection {
  std::string address;
  rpc::AccessChoice choice;
  rpc::ShownAccess shown;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<Stub> stub;
  Client::FindServer find_server;

  absl::Status Open(const Client::Place& where) {
    ASSIGN_OR_RETURN(shown, rpc::FindShownAccess(where.address, where.access));
    address = where.address;
    choice = where.access;
    channel = rpc::OpenChannel(address, shown.access);
    stub = v1::Campaigns::NewStub(channel);
    return absl::OkStatus();
  }

  /// After the server was lost: true once it, or who took its place, can be asked.
  bool Return() {
    const auto end = std::chrono::steady_clock::now() + kReturn;
    do {
      std::this_thread::sleep_for(kLull);
      if (Interrupted()) return false;
      if (find_server) {
        const Client::Place found = find_server();
        if (found.address.empty()) return false;
        const bool is_here = found.address == address && found.access == choice;
        if (!is_here && !Open(found).ok()) return false;
      }
      if (channel->WaitForConnected(std::chrono::system_clock::now() + kConnect)) return true;
    } while (std::chrono::steady_clock::now() < end);
    return false;
  }

  /// After what was shown was refused: true if something else can be shown by now, over a new
  /// connection.
  bool ShowAnother() {
    const auto now = rpc::FindShownAccess(address, choice);
    return now.ok() && *now != shown && Open({.address = address, .access = choice}).ok();
  }
};

absl::Status NoAnswer(const grpc::Status& last) {
  const bool is_late = last.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
  const std::string why =
      is_late ? "the server has not answered for minutes" : "the connection to the server was lost";
  return {is_late ? absl::StatusCode::kDeadlineExceeded : absl::StatusCode::kUnavailable,
          absl::StrCat(why, " (", last.error_message(),
                       "); what was submitted goes on there, and the same command again goes on "
                       "from what is done")};
}

// Calls ask(stub, context), which returns a grpc::Status, again when its deadline passes or the
// connection is lost.
template <typename Ask>
absl::Status Insist(Connection& connection, std::optional<std::chrono::milliseconds> deadline,
                    const Ask& ask) {
  int late = 0;
  int lost = 0;
  while (true) {
    grpc::ClientContext context;
    if (deadline) rpc::SetDeadline(context, *deadline);
    const grpc::Status status = ask(*connection.stub, context);
    switch (status.error_code()) {
      case grpc::StatusCode::OK:
        return absl::OkStatus();
      case grpc::StatusCode::DEADLINE_EXCEEDED:
        if (++late >= kLateAnswers || Interrupted()) return NoAnswer(status);
        break;
      case grpc::StatusCode::CANCELLED:  // by a server that ends
      case grpc::StatusCode::UNAVAILABLE:
        if (++lost > kLostConnections || !connection.Return()) return NoAnswer(status);
        break;
      case grpc::StatusCode::UNAUTHENTICATED:
        if (!connection.ShowAnother()) return rpc::FromGrpc(status);
        break;
      default:
        return rpc::FromGrpc(status);
    }
  }
}

// What came in keeps the rules of its fields, as what goes out does at the other end.
absl::Status Checked(const google::protobuf::Message& message) {
  const absl::Status status = rpc::CheckMessage(message);
  return status.ok() ? status
                     : absl::DataLossError(absl::StrCat("the server has sent what it must not: ",
                                                        status.message()));
}

template <typename Reply, typename Request>
absl::StatusOr<Reply> Call(Connection& connection,
                           grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                        Reply*),
                           const Request& request) {
  Reply reply;
  auto answered =
      Insist(connection, rpc::kUnaryDeadline, [&](Stub& stub, grpc::ClientContext& context) {
        reply.Clear();
        return (stub.*method)(&context, request, &reply);
      });
  RETURN_IF_ERROR(answered);
  RETURN_IF_ERROR(Checked(reply));
  return reply;
}

// All messages of one stream.
template <typename Message, typename Request>
absl::StatusOr<std::vector<Message>> Collect(
    Connection& connection,
    std::unique_ptr<grpc::ClientReader<Message>> (Stub::*method)(grpc::ClientContext*,
                                                                 const Request&),
    const Request& request) {
  std::vector<Message> messages;
  auto answered = Insist(connection, kLongestStream, [&](Stub& stub, grpc::ClientContext& context) {
    messages.clear();
    const auto reader = (stub.*method)(&context, request);
    Message message;
    while (reader->Read(&message)) messages.push_back(message);
    return reader->Finish();
  });
  RETURN_IF_ERROR(answered);
  for (const Message& message : messages) RETURN_IF_ERROR(Checked(message));
  return messages;
}

v1::CampaignRequest Of(const std::string& campaign) {
  v1::CampaignRequest request;
  request.set_campaign(campaign);
  return request;
}

v1::ControlRequest ControlOf(const std::string& campaign) {
  v1::ControlRequest request;
  request.set_campaign(campaign);
  request.set_request_id(rpc::RandomId());
  return request;
}

}  // namespace

struct Client::Impl {
  Connection connection;
};

Client::Client(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Client::~Client() = default;

absl::StatusOr<std::unique_ptr<Client>> Client::Connect(const std::string& address,
                                                        const rpc::AccessChoice& access) {
  if (const std::string problem = rpc::ProblemOfAddress(address); !problem.empty()) {
    return absl::InvalidArgumentError(problem);  // of $CALIB_SERVER: options are checked before
  }
  auto impl = std::make_unique<Impl>();
  RETURN_IF_ERROR(impl->connection.Open({.address = address, .access = access}));
  if (!impl->connection.channel->WaitForConnected(std::chrono::system_clock::now() + kConnect)) {
    const absl::Status why = rpc::WhyNotConnected(address, impl->connection.shown.access);
    if (absl::IsUnavailable(why)) {
      return absl::UnavailableError(
          absl::StrCat(why.message(),
                       "; start one with `calibd --state DIR`, name another with "
                       "--server HOST:PORT, or work on a folder with --state DIR"));
    }
    RETURN_IF_ERROR(why);  // OK: it has come meanwhile
  }
  return std::unique_ptr<Client>(new Client(std::move(impl)));
}

std::unique_ptr<Client> Client::Over(std::shared_ptr<grpc::Channel> channel) {
  auto impl = std::make_unique<Impl>();
  impl->connection.stub = v1::Campaigns::NewStub(channel);
  impl->connection.channel = std::move(channel);
  impl->connection.find_server = [] { return Place{}; };
  return std::unique_ptr<Client>(new Client(std::move(impl)));
}

void Client::OnLoss(FindServer find_server) {
  impl_->connection.find_server = std::move(find_server);
}

absl::Status Client::PutBlob(const std::string& content) {
  return Insist(impl_->connection, rpc::kBlobDeadline,
                [&content](Stub& stub, grpc::ClientContext& context) {
                  v1::BlobReceipt receipt;
                  const auto writer = stub.PutBlob(&context, &receipt);
                  for (const v1::BlobChunk& chunk : rpc::ToChunks(content)) {
                    if (!writer->Write(chunk)) break;  // Finish() says why
                  }
                  writer->WritesDone();
                  return writer->Finish();
                });
}

absl::StatusOr<std::string> Client::GetBlob(const std::string& digest) {
  v1::BlobByDigest request;
  request.set_digest(digest);
  ASSIGN_OR_RETURN(const auto chunks, Collect(impl_->connection, &Stub::GetBlob, request));
  rpc::BlobAssembler assembler;
  for (const v1::BlobChunk& chunk : chunks) {
    RETURN_IF_ERROR(assembler.Add(chunk));
  }
  return assembler.Finish();
}

absl::StatusOr<v1::SubmitReply> Client::Submit(const v1::SubmitRequest& request) {
  return Call<v1::SubmitReply>(impl_->connection, &Stub::Submit, request);
}

absl::StatusOr<v1::CampaignStatus> Client::AddRuns(const v1::AddRunsRequest& request) {
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::AddRuns, request);
}

absl::StatusOr<std::vector<v1::CampaignStatus>> Client::List(const Part& part) {
  v1::ListRequest request;
  request.set_after(part.after);
  request.set_parent(part.parent);
  std::vector<v1::CampaignStatus> campaigns;
  while (true) {  // no message holds them all
    const int wanted =
        part.limit ? *part.limit - static_cast<int>(campaigns.size()) : kCampaignsOfAPage;
    request.set_limit(std::clamp(wanted, 1, kCampaignsOfAPage));
    ASSIGN_OR_RETURN(const auto reply,
                     Call<v1::ListReply>(impl_->connection, &Stub::List, request));
    campaigns.insert(campaigns.end(), reply.campaigns().begin(), reply.campaigns().end());
    if (part.limit && campaigns.size() >= static_cast<std::size_t>(*part.limit)) {
      campaigns.resize(static_cast<std::size_t>(*part.limit));
      return campaigns;
    }
    if (reply.campaigns_size() < request.limit()) return campaigns;
    request.set_after(campaigns.back().campaign());
  }
}

absl::StatusOr<v1::CampaignStatus> Client::Show(const std::string& campaign) {
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::Show, Of(campaign));
}

absl::Status Client::Watch(const std::string& campaign,
                           const std::function<void(const v1::CampaignStatus&)>& seen) {
  absl::Status checked;
  absl::Status watched =
      Insist(impl_->connection, std::nullopt, [&](Stub& stub, grpc::ClientContext& context) {
        const auto reader = stub.Watch(&context, Of(campaign));
        v1::CampaignStatus status;
        while (reader->Read(&status)) {
          checked = Checked(status);
          if (!checked.ok()) {
            context.TryCancel();
            reader->Finish();
            return grpc::Status::OK;
          }
          seen(status);
        }
        return reader->Finish();
      });
  return checked.ok() ? watched : checked;
}

absl::Status Client::WatchChanges(const std::stop_token& stop,
                                  const std::function<void(const v1::Changes&)>& seen) {
  grpc::ClientContext context;
  const auto reader = impl_->connection.stub->WatchChanges(&context, v1::WatchChangesRequest());
  const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
  absl::Status checked;
  v1::Changes changes;
  while (checked.ok() && reader->Read(&changes)) {
    checked = Checked(changes);
    if (checked.ok()) {
      seen(changes);
    } else {
      context.TryCancel();
    }
  }
  const grpc::Status ended = reader->Finish();
  if (!checked.ok() || stop.stop_requested()) return checked;
  return ended.ok() ? absl::UnavailableError("the server has ended the stream")
                    : rpc::FromGrpc(ended);
}

absl::StatusOr<v1::Posterior> Client::GetPosterior(const std::string& campaign,
                                                   std::optional<int> iteration) {
  v1::PosteriorRequest request;
  request.set_campaign(campaign);
  if (iteration) request.set_iteration(*iteration);
  return Call<v1::Posterior>(impl_->connection, &Stub::GetPosterior, request);
}

absl::StatusOr<std::vector<v1::Sample>> Client::GetSamples(const std::string& campaign) {
  return Collect(impl_->connection, &Stub::GetSamples, Of(campaign));
}

absl::StatusOr<std::vector<v1::SampleStates>> Client::GetStates(const std::string& campaign,
                                                                std::optional<int> sample) {
  v1::StatesRequest request;
  request.set_campaign(campaign);
  if (sample) request.set_sample(*sample);
  return Collect(impl_->connection, &Stub::GetStates, request);
}

absl::StatusOr<v1::CampaignSource> Client::GetSource(const std::string& campaign) {
  return Call<v1::CampaignSource>(impl_->connection, &Stub::GetSource, Of(campaign));
}

absl::StatusOr<std::vector<v1::LogEntry>> Client::GetLog(const std::string& campaign) {
  return Collect(impl_->connection, &Stub::GetLog, Of(campaign));
}

absl::Status Client::AddFinding(const std::string& campaign, const std::string& kind,
                                const std::string& document) {
  RETURN_IF_ERROR(PutBlob(document));
  v1::AddFindingRequest request;
  request.set_campaign(campaign);
  request.set_kind(kind);
  request.set_digest(rpc::Sha256Hex(document));
  return Call<v1::Finding>(impl_->connection, &Stub::AddFinding, request).status();
}

absl::StatusOr<std::vector<v1::Finding>> Client::Findings(const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto list,
                   Call<v1::FindingList>(impl_->connection, &Stub::ListFindings, Of(campaign)));
  return std::vector<v1::Finding>(list.findings().begin(), list.findings().end());
}

absl::StatusOr<v1::CampaignStatus> Client::Pause(const std::string& campaign) {
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::Pause, ControlOf(campaign));
}

absl::StatusOr<v1::CampaignStatus> Client::Resume(const std::string& campaign) {
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::Resume, ControlOf(campaign));
}

absl::StatusOr<v1::CampaignStatus> Client::Cancel(const std::string& campaign) {
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::Cancel, ControlOf(campaign));
}

absl::StatusOr<v1::CampaignStatus> Client::SetPriority(const std::string& campaign, int priority) {
  v1::PriorityRequest request;
  request.set_campaign(campaign);
  request.set_request_id(rpc::RandomId());
  request.set_priority(priority);
  return Call<v1::CampaignStatus>(impl_->connection, &Stub::SetPriority, request);
}

absl::StatusOr<v1::OwnerShare> Client::SetQuota(const std::string& owner,
                                                std::optional<int> slots) {
  v1::QuotaRequest request;
  request.set_owner(owner);
  if (slots) request.set_slots(*slots);
  return Call<v1::OwnerShare>(impl_->connection, &Stub::SetQuota, request);
}

absl::StatusOr<std::vector<v1::OwnerShare>> Client::ListShares() {
  ASSIGN_OR_RETURN(const auto reply,
                   Call<v1::ShareList>(impl_->connection, &Stub::ListShares, v1::SharesRequest()));
  return std::vector<v1::OwnerShare>(reply.shares().begin(), reply.shares().end());
}

absl::Status Client::Delete(const std::string& campaign) {
  return Call<v1::DeleteReply>(impl_->connection, &Stub::Delete, ControlOf(campaign)).status();
}

absl::StatusOr<std::vector<v1::WorkerInfo>> Client::ListWorkers() {
  ASSIGN_OR_RETURN(const auto reply, Call<v1::WorkerList>(impl_->connection, &Stub::ListWorkers,
                                                          v1::ListWorkersRequest()));
  return std::vector<v1::WorkerInfo>(reply.workers().begin(), reply.workers().end());
}

absl::StatusOr<v1::WorkerInfo> Client::DrainWorker(const std::string& worker,
                                                   std::chrono::milliseconds within) {
  v1::DrainRequest request;
  request.set_worker(worker);
  request.set_request_id(rpc::RandomId());
  request.set_within_ms(static_cast<int>(within.count()));
  return Call<v1::WorkerInfo>(impl_->connection, &Stub::DrainWorker, request);
}

absl::StatusOr<v1::ServerReport> Client::Examine() {
  return Call<v1::ServerReport>(impl_->connection, &Stub::Examine, v1::ExamineRequest());
}

absl::StatusOr<messages::BackupSeal> Client::Backup(const BackupSink& sink) {
  messages::BackupSeal seal;
  absl::Status failed;  // here, not on the way
  const auto answered =
      Insist(impl_->connection, kLongestBackup, [&](Stub& stub, grpc::ClientContext& context) {
        rpc::Sha256 digest;
        seal = {};
        failed = sink.begin();
        if (!failed.ok()) return grpc::Status::OK;
        const auto reader = stub.Backup(&context, v1::BackupRequest());
        v1::BlobChunk chunk;
        while (failed.ok() && reader->Read(&chunk)) {
          failed = Checked(chunk);
          if (seal.bytes == 0) seal.digest = chunk.digest();
          seal.bytes += static_cast<std::int64_t>(chunk.data().size());
          digest.Update(chunk.data());
          if (failed.ok()) failed = sink.add(chunk.data());
        }
        if (!failed.ok()) context.TryCancel();
        const grpc::Status status = reader->Finish();
        if (failed.ok() && status.ok() && digest.Finish() != seal.digest) {
          failed = absl::DataLossError("the backup has changed on its way: take it again");
        }
        return failed.ok() ? status : grpc::Status::OK;
      });
  RETURN_IF_ERROR(failed);
  RETURN_IF_ERROR(answered);
  return seal;
}

absl::StatusOr<v1::PruneReply> Client::Prune(std::optional<int> keep_states) {
  v1::PruneRequest request;
  if (keep_states) request.set_keep_states(*keep_states);
  return Call<v1::PruneReply>(impl_->connection, &Stub::Prune, request);
}

absl::StatusOr<v1::Metrics> Client::GetMetrics() {
  return Call<v1::Metrics>(impl_->connection, &Stub::GetMetrics, v1::MetricsRequest());
}

}  // namespace calib::client
