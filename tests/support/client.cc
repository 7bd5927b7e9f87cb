#include "tests/support/client.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "calib/v1/campaign.grpc.pb.h"
#include "calib/v1/worker.grpc.pb.h"
#include "dem/registry/catalog.h"
#include "proto/calib/v1/protocol.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/status.h"

namespace calib::testing {

struct Client::Impl {
  std::unique_ptr<v1::Campaigns::Stub> stub;

  template <typename Request, typename Reply>
  absl::StatusOr<Reply> Call(grpc::Status (v1::Campaigns::Stub::*method)(grpc::ClientContext*,
                                                                         const Request&, Reply*),
                             const Request& request) {
    grpc::ClientContext context;
    rpc::SetDeadline(context, rpc::kUnaryDeadline);
    Reply reply;
    if (const absl::Status status = rpc::FromGrpc((stub.get()->*method)(&context, request, &reply));
        !status.ok()) {
      return status;
    }
    return reply;
  }

  template <typename Message, typename Request>
  absl::StatusOr<std::vector<Message>> Collect(
      std::unique_ptr<grpc::ClientReader<Message>> (v1::Campaigns::Stub::*method)(
          grpc::ClientContext*, const Request&),
      const Request& request, std::chrono::milliseconds limit) {
    grpc::ClientContext context;
    rpc::SetDeadline(context, limit);
    auto reader = (stub.get()->*method)(&context, request);
    std::vector<Message> messages;
    for (Message message; reader->Read(&message);) {
      messages.push_back(message);
    }
    if (const absl::Status status = rpc::FromGrpc(reader->Finish()); !status.ok()) {
      return status;
    }
    return messages;
  }
};

namespace {

v1::CampaignRequest Named(const std::string& campaign) {
  v1::CampaignRequest request;
  request.set_campaign(campaign);
  return request;
}

}  // namespace

Client::Client(const std::string& address, const rpc::AccessChoice& access)
    : impl_(std::make_unique<Impl>(Impl{.stub = v1::Campaigns::NewStub(rpc::OpenChannel(
                                            address, rpc::FindAccess(address, access).value()))})) {
}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

absl::Status Client::PutBlob(const std::string& content) {
  grpc::ClientContext context;
  rpc::SetDeadline(context, rpc::kBlobDeadline);
  v1::BlobReceipt receipt;
  auto writer = impl_->stub->PutBlob(&context, &receipt);
  for (const v1::BlobChunk& chunk : rpc::ToChunks(content)) {
    writer->Write(chunk);
  }
  writer->WritesDone();
  return rpc::FromGrpc(writer->Finish());
}

absl::StatusOr<v1::SubmitReply> Client::Submit(const v1::SubmitRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::Submit, request);
}

absl::StatusOr<v1::CampaignStatus> Client::AddRuns(const v1::AddRunsRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::AddRuns, request);
}

absl::StatusOr<std::string> Client::SubmitCampaign(const std::string& yaml,
                                                   const std::map<std::string, std::string>& files,
                                                   const std::string& request_id) {
  v1::SubmitRequest request;
  request.set_request_id(request_id);
  request.set_campaign_file(yaml);
  request.set_file_name("campaign.yaml");
  for (const auto& [path, content] : files) {
    if (absl::Status status = PutBlob(content); !status.ok()) {
      return status;
    }
    (*request.mutable_files())[path] = rpc::Sha256Hex(content);
  }
  const auto reply = Submit(request);
  if (!reply.ok()) {
    return reply.status();
  }
  if (reply->problems_size() > 0) {
    std::string text;
    for (const v1::Problem& problem : reply->problems()) {
      text += problem.file() + ":" + std::to_string(problem.line()) + ": " + problem.key() + ": " +
              problem.message() + "\n";
    }
    return absl::InvalidArgumentError(text);
  }
  return reply->campaign();
}

absl::StatusOr<v1::CampaignStatus> Client::Show(const std::string& campaign) {
  return impl_->Call(&v1::Campaigns::Stub::Show, Named(campaign));
}

absl::StatusOr<v1::ListReply> Client::List() {
  return impl_->Call(&v1::Campaigns::Stub::List, v1::ListRequest());
}

absl::StatusOr<v1::Posterior> Client::Posterior(const std::string& campaign) {
  v1::PosteriorRequest request;
  request.set_campaign(campaign);
  return impl_->Call(&v1::Campaigns::Stub::GetPosterior, request);
}

absl::StatusOr<std::vector<v1::Sample>> Client::Samples(const std::string& campaign) {
  return impl_->Collect<v1::Sample>(&v1::Campaigns::Stub::GetSamples, Named(campaign),
                                    rpc::kUnaryDeadline);
}

absl::StatusOr<std::vector<v1::SampleStates>> Client::States(const std::string& campaign) {
  v1::StatesRequest request;
  request.set_campaign(campaign);
  return impl_->Collect<v1::SampleStates>(&v1::Campaigns::Stub::GetStates, request,
                                          rpc::kUnaryDeadline);
}

absl::StatusOr<std::vector<v1::LogEntry>> Client::Log(const std::string& campaign) {
  return impl_->Collect<v1::LogEntry>(&v1::Campaigns::Stub::GetLog, Named(campaign),
                                      rpc::kUnaryDeadline);
}

absl::StatusOr<v1::WorkerList> Client::Workers() {
  return impl_->Call(&v1::Campaigns::Stub::ListWorkers, v1::ListWorkersRequest());
}

absl::StatusOr<v1::WorkerInfo> Client::Drain(const std::string& worker,
                                             std::chrono::milliseconds within) {
  v1::DrainRequest request;
  request.set_worker(worker);
  request.set_within_ms(static_cast<int>(within.count()));
  return impl_->Call(&v1::Campaigns::Stub::DrainWorker, request);
}

absl::StatusOr<v1::ServerReport> Client::Examine() {
  return impl_->Call(&v1::Campaigns::Stub::Examine, v1::ExamineRequest());
}

absl::StatusOr<v1::CampaignStatus> Client::Pause(const v1::ControlRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::Pause, request);
}

absl::StatusOr<v1::CampaignStatus> Client::Resume(const v1::ControlRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::Resume, request);
}

absl::StatusOr<v1::CampaignStatus> Client::Cancel(const v1::ControlRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::Cancel, request);
}

absl::Status Client::Delete(const v1::ControlRequest& request) {
  return impl_->Call(&v1::Campaigns::Stub::Delete, request).status();
}

absl::StatusOr<std::vector<v1::CampaignStatus>> Client::Watch(const std::string& campaign,
                                                              std::chrono::milliseconds limit) {
  return impl_->Collect<v1::CampaignStatus>(&v1::Campaigns::Stub::Watch, Named(campaign), limit);
}

struct FakeWorker::Impl {
  std::unique_ptr<v1::WorkerLink::Stub> stub;
  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReaderWriter<v1::WorkerMessage, v1::ServerMessage>> stream;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<v1::ServerMessage> received;
  bool ended = false;
  std::thread reader;
};

FakeWorker::FakeWorker(const std::string& address, const v1::Hello& hello)
    : impl_(std::make_unique<Impl>()) {
  impl_->stub =
      v1::WorkerLink::NewStub(rpc::OpenChannel(address, rpc::FindAccess(address, {}).value()));
  impl_->context.set_wait_for_ready(true);
  impl_->stream = impl_->stub->Connect(&impl_->context);
  v1::WorkerMessage message;
  *message.mutable_hello() = hello;
  Send(message);
  impl_->reader = std::thread([impl = impl_.get()] {
    for (v1::ServerMessage incoming; impl->stream->Read(&incoming);) {
      const std::lock_guard<std::mutex> lock(impl->mutex);
      impl->received.push_back(incoming);
      impl->changed.notify_all();
    }
    const std::lock_guard<std::mutex> lock(impl->mutex);
    impl->ended = true;
    impl->changed.notify_all();
  });
}

FakeWorker::~FakeWorker() {
  if (impl_->reader.joinable()) {
    Cut();
    Finish().IgnoreError();
  }
}

bool FakeWorker::Send(const v1::WorkerMessage& message) { return impl_->stream->Write(message); }

std::optional<v1::ServerMessage> FakeWorker::Receive(std::chrono::milliseconds limit) {
  std::unique_lock<std::mutex> lock(impl_->mutex);
  impl_->changed.wait_for(lock, limit, [this] { return !impl_->received.empty() || impl_->ended; });
  if (impl_->received.empty()) {
    return std::nullopt;
  }
  v1::ServerMessage message = impl_->received.front();
  impl_->received.pop_front();
  return message;
}

std::optional<v1::ServerMessage> FakeWorker::Receive(v1::ServerMessage::MessageCase kind,
                                                     std::chrono::milliseconds limit) {
  while (auto message = Receive(limit)) {
    if (message->message_case() == kind) {
      return message;
    }
  }
  return std::nullopt;
}

absl::Status FakeWorker::Finish() {
  impl_->reader.join();
  return rpc::FromGrpc(impl_->stream->Finish());
}

void FakeWorker::Cut() { impl_->context.TryCancel(); }

v1::Hello MatchingHello(const std::string& name, int slots) {
  v1::Hello hello;
  hello.set_name(name);
  hello.set_instance("of " + name);
  hello.set_slots(slots);
  hello.set_threads_per_slot(1);
  hello.set_engine_version(dem::EngineVersion());
  hello.set_catalog_digest(rpc::Sha256Hex(dem::CatalogText()));
  hello.set_protocol(kProtocol);
  hello.add_features(kLimitsRuns);
  return hello;
}

}  // namespace calib::testing
