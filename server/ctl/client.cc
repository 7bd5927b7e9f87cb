#include "server/ctl/client.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <chrono>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/v1/campaign.grpc.pb.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/status.h"

namespace calib::ctl {
namespace {

constexpr std::chrono::milliseconds kConnect{1800};
constexpr std::chrono::minutes kLongestStream{10};

/// A server that is slow to answer (a disk that stalls, a machine that sleeps) or is started again
/// is asked again, so that hours of a diagnosis do not end with one late answer. Every call may be
/// made twice: those that change something carry a request_id.
constexpr int kLateAnswers = 10;
constexpr int kLostConnections = 2;  // each waits for the next one up to the call's deadline

using Stub = v1::Campaigns::Stub;

absl::Status NoAnswer(const grpc::Status& last) {
  const std::string why = last.error_code() == grpc::StatusCode::UNAVAILABLE
                              ? "the connection to the server was lost"
                              : "the server has not answered for minutes";
  return {static_cast<absl::StatusCode>(last.error_code()),
          absl::StrCat(why, " (", last.error_message(),
                       "); what was submitted goes on there, and the same command again goes on "
                       "from what is done")};
}

// One unary call, asked again when its deadline passes or the connection is lost.
template <typename Reply, typename Request>
absl::StatusOr<Reply> Call(Stub& stub,
                           grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                        Reply*),
                           const Request& request) {
  int late = 0;
  int lost = 0;
  while (true) {
    grpc::ClientContext context;
    context.set_wait_for_ready(lost > 0);
    rpc::SetDeadline(context, rpc::kUnaryDeadline);
    Reply reply;
    const grpc::Status status = (stub.*method)(&context, request, &reply);
    if (status.ok()) return reply;
    const bool is_late = status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
    const bool is_lost = status.error_code() == grpc::StatusCode::UNAVAILABLE;
    if (!is_late && !is_lost) return rpc::FromGrpc(status);
    late += is_late ? 1 : 0;
    if (is_lost) {
      ++lost;
      late = 0;  // a connection that does not come back is late from then on
    }
    if (lost > kLostConnections || late >= (lost > 0 ? kLostConnections : kLateAnswers)) {
      return NoAnswer(status);
    }
  }
}

// All messages of one stream.
template <typename Message, typename Request>
absl::StatusOr<std::vector<Message>> Collect(
    Stub& stub,
    std::unique_ptr<grpc::ClientReader<Message>> (Stub::*method)(grpc::ClientContext*,
                                                                 const Request&),
    const Request& request) {
  grpc::ClientContext context;
  rpc::SetDeadline(context, kLongestStream);
  const auto reader = (stub.*method)(&context, request);
  std::vector<Message> messages;
  Message message;
  while (reader->Read(&message)) messages.push_back(message);
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return rpc::FromGrpc(status);
  return messages;
}

v1::CampaignRequest Of(const std::string& campaign) {
  v1::CampaignRequest request;
  request.set_campaign(campaign);
  return request;
}

// A name that no other request bears.
std::string NewRequestId() {
  std::random_device device;
  std::string id;
  for (int word = 0; word < 4; ++word) absl::StrAppend(&id, absl::Hex(device(), absl::kZeroPad8));
  return id;
}

v1::ControlRequest ControlOf(const std::string& campaign) {
  v1::ControlRequest request;
  request.set_campaign(campaign);
  request.set_request_id(NewRequestId());
  return request;
}

}  // namespace

struct Client::Impl {
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<Stub> stub;
};

Client::Client(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Client::~Client() = default;

absl::StatusOr<std::unique_ptr<Client>> Client::Connect(const std::string& address) {
  auto impl = std::make_unique<Impl>();
  impl->channel = rpc::OpenChannel(address);
  if (!impl->channel->WaitForConnected(std::chrono::system_clock::now() + kConnect)) {
    return absl::UnavailableError(
        absl::StrCat("no server answers at ", address,
                     "; start one with `calibd --state DIR`, name another with --server HOST:PORT, "
                     "or work on a folder with --state DIR"));
  }
  impl->stub = v1::Campaigns::NewStub(impl->channel);
  return std::unique_ptr<Client>(new Client(std::move(impl)));
}

absl::Status Client::PutBlob(const std::string& content) {
  grpc::ClientContext context;
  rpc::SetDeadline(context, rpc::kBlobDeadline);
  v1::BlobReceipt receipt;
  const auto writer = impl_->stub->PutBlob(&context, &receipt);
  for (const v1::BlobChunk& chunk : rpc::ToChunks(content)) {
    if (!writer->Write(chunk)) break;  // Finish() says why
  }
  writer->WritesDone();
  return rpc::FromGrpc(writer->Finish());
}

absl::StatusOr<std::string> Client::GetBlob(const std::string& digest) {
  v1::BlobByDigest request;
  request.set_digest(digest);
  const auto chunks = Collect(*impl_->stub, &Stub::GetBlob, request);
  if (!chunks.ok()) return chunks.status();
  rpc::BlobAssembler assembler;
  for (const v1::BlobChunk& chunk : *chunks) {
    if (auto added = assembler.Add(chunk); !added.ok()) return added;
  }
  return assembler.Finish();
}

absl::StatusOr<v1::SubmitReply> Client::Submit(const v1::SubmitRequest& request) {
  return Call<v1::SubmitReply>(*impl_->stub, &Stub::Submit, request);
}

absl::StatusOr<std::vector<v1::CampaignStatus>> Client::List() {
  const auto reply = Call<v1::ListReply>(*impl_->stub, &Stub::List, v1::ListRequest());
  if (!reply.ok()) return reply.status();
  return std::vector<v1::CampaignStatus>(reply->campaigns().begin(), reply->campaigns().end());
}

absl::StatusOr<v1::CampaignStatus> Client::Show(const std::string& campaign) {
  return Call<v1::CampaignStatus>(*impl_->stub, &Stub::Show, Of(campaign));
}

absl::Status Client::Watch(const std::string& campaign,
                           const std::function<void(const v1::CampaignStatus&)>& seen) {
  grpc::ClientContext context;
  const auto reader = impl_->stub->Watch(&context, Of(campaign));
  v1::CampaignStatus status;
  while (reader->Read(&status)) seen(status);
  return rpc::FromGrpc(reader->Finish());
}

absl::StatusOr<v1::Posterior> Client::GetPosterior(const std::string& campaign,
                                                   std::optional<int> iteration) {
  v1::PosteriorRequest request;
  request.set_campaign(campaign);
  if (iteration) request.set_iteration(*iteration);
  return Call<v1::Posterior>(*impl_->stub, &Stub::GetPosterior, request);
}

absl::StatusOr<std::vector<v1::Sample>> Client::GetSamples(const std::string& campaign) {
  return Collect(*impl_->stub, &Stub::GetSamples, Of(campaign));
}

absl::StatusOr<std::vector<v1::SampleStates>> Client::GetStates(const std::string& campaign,
                                                                std::optional<int> sample) {
  v1::StatesRequest request;
  request.set_campaign(campaign);
  if (sample) request.set_sample(*sample);
  return Collect(*impl_->stub, &Stub::GetStates, request);
}

absl::StatusOr<v1::CampaignSource> Client::GetSource(const std::string& campaign) {
  return Call<v1::CampaignSource>(*impl_->stub, &Stub::GetSource, Of(campaign));
}

absl::StatusOr<std::vector<v1::LogEntry>> Client::GetLog(const std::string& campaign) {
  return Collect(*impl_->stub, &Stub::GetLog, Of(campaign));
}

absl::Status Client::AddFinding(const std::string& campaign, const std::string& kind,
                                const std::string& document) {
  if (auto put = PutBlob(document); !put.ok()) return put;
  v1::AddFindingRequest request;
  request.set_campaign(campaign);
  request.set_kind(kind);
  request.set_digest(rpc::Sha256Hex(document));
  return Call<v1::Finding>(*impl_->stub, &Stub::AddFinding, request).status();
}

absl::StatusOr<std::vector<v1::Finding>> Client::Findings(const std::string& campaign) {
  const auto list = Call<v1::FindingList>(*impl_->stub, &Stub::ListFindings, Of(campaign));
  if (!list.ok()) return list.status();
  return std::vector<v1::Finding>(list->findings().begin(), list->findings().end());
}

absl::StatusOr<v1::CampaignStatus> Client::Pause(const std::string& campaign) {
  return Call<v1::CampaignStatus>(*impl_->stub, &Stub::Pause, ControlOf(campaign));
}

absl::StatusOr<v1::CampaignStatus> Client::Resume(const std::string& campaign) {
  return Call<v1::CampaignStatus>(*impl_->stub, &Stub::Resume, ControlOf(campaign));
}

absl::StatusOr<v1::CampaignStatus> Client::Cancel(const std::string& campaign) {
  return Call<v1::CampaignStatus>(*impl_->stub, &Stub::Cancel, ControlOf(campaign));
}

absl::Status Client::Delete(const std::string& campaign) {
  return Call<v1::DeleteReply>(*impl_->stub, &Stub::Delete, ControlOf(campaign)).status();
}

absl::StatusOr<std::vector<v1::WorkerInfo>> Client::ListWorkers() {
  const auto reply =
      Call<v1::WorkerList>(*impl_->stub, &Stub::ListWorkers, v1::ListWorkersRequest());
  if (!reply.ok()) return reply.status();
  return std::vector<v1::WorkerInfo>(reply->workers().begin(), reply->workers().end());
}

absl::StatusOr<v1::WorkerInfo> Client::DrainWorker(const std::string& worker) {
  v1::DrainRequest request;
  request.set_worker(worker);
  request.set_request_id(NewRequestId());
  return Call<v1::WorkerInfo>(*impl_->stub, &Stub::DrainWorker, request);
}

absl::StatusOr<v1::ServerReport> Client::Examine() {
  return Call<v1::ServerReport>(*impl_->stub, &Stub::Examine, v1::ExamineRequest());
}

}  // namespace calib::ctl
