#include "tests/support/attacker.h"

#include <arpa/inet.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/generic/generic_stub.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/v1/campaign.grpc.pb.h"
#include "calib/v1/worker.grpc.pb.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/status.h"

namespace calib::testing {
namespace {

/// A call that has not ended by then is not answered.
constexpr std::chrono::seconds kUnanswered{20};

/// Cuts a call when the time is up, unless the scope was left before.
class CutAfter {
 public:
  CutAfter(grpc::ClientContext& context, std::chrono::milliseconds limit)
      : thread_([&context, limit](std::stop_token stop) {
          const auto end = std::chrono::steady_clock::now() + limit;
          while (!stop.stop_requested() && std::chrono::steady_clock::now() < end) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
          }
          context.TryCancel();
        }) {}

 private:
  std::jthread thread_;
};

}  // namespace

struct Attacker::Impl {
  explicit Impl(const std::string& address)
      : channel(rpc::OpenChannel(address, rpc::FindAccess(address, {}).value())) {}
  std::shared_ptr<grpc::Channel> channel;
};

Attacker::Attacker(const std::string& address) : impl_(std::make_unique<Impl>(address)) {}
Attacker::~Attacker() = default;

absl::Status Attacker::Call(const google::protobuf::MethodDescriptor& method,
                            const google::protobuf::Message& message) {
  grpc::GenericStub stub(impl_->channel);
  grpc::ClientContext context;
  rpc::SetDeadline(context, kUnanswered);
  grpc::CompletionQueue queue;
  const std::string name = absl::StrCat("/", std::string(method.service()->full_name()), "/",
                                        std::string(method.name()));
  const auto call = stub.PrepareCall(&context, name, &queue);
  const auto done = [&queue] {  // one operation is under way at a time
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  grpc::Slice slice(message.SerializePartialAsString());
  call->StartCall(&context);
  if (done()) {
    call->WriteLast(grpc::ByteBuffer(&slice, 1), grpc::WriteOptions(), &context);
    if (done()) {
      grpc::ByteBuffer answer;
      do {
        call->Read(&answer, &context);
      } while (done());
    }
  }
  grpc::Status status;
  call->Finish(&status, &context);
  done();
  queue.Shutdown();
  return rpc::FromGrpc(status);
}

int Attacker::FloodWithoutReading(const v1::Hello& hello, const v1::WorkerMessage& message,
                                  int times, std::chrono::milliseconds limit) {
  const auto stub = v1::WorkerLink::NewStub(impl_->channel);
  grpc::ClientContext context;
  const auto stream = stub->Connect(&context);
  v1::WorkerMessage first;
  *first.mutable_hello() = hello;
  int taken = 0;
  {
    const CutAfter cut(context, limit);
    if (stream->Write(first)) {
      while (taken < times && stream->Write(message)) ++taken;
    }
  }
  stream->Finish();
  return taken;
}

std::int64_t Attacker::UploadWithoutEnd(std::int64_t bytes, std::chrono::milliseconds limit) {
  const auto stub = v1::Campaigns::NewStub(impl_->channel);
  grpc::ClientContext context;
  v1::BlobReceipt receipt;
  const auto writer = stub->PutBlob(&context, &receipt);
  v1::BlobChunk chunk;
  chunk.set_digest(std::string(64, 'a'));
  chunk.set_data(std::string(rpc::kChunkBytes, 'x'));
  std::int64_t taken = 0;
  const auto end = std::chrono::steady_clock::now() + limit;
  {
    const CutAfter cut(context, limit);
    while (taken < bytes && writer->Write(chunk)) {
      taken += static_cast<std::int64_t>(rpc::kChunkBytes);
    }
    if (taken >= bytes) std::this_thread::sleep_until(end);
  }
  writer->Finish();
  return taken;
}

void Attacker::DownloadWithoutReading(const std::string& digest, int times,
                                      std::chrono::milliseconds limit) {
  const auto stub = v1::Campaigns::NewStub(impl_->channel);
  v1::BlobByDigest request;
  request.set_digest(digest);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::BlobChunk>>> readers;
  for (int k = 0; k < times; ++k) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(stub->GetBlob(contexts.back().get(), request));
  }
  std::this_thread::sleep_for(limit);
  for (int k = 0; k < times; ++k) {
    contexts[static_cast<std::size_t>(k)]->TryCancel();
    v1::BlobChunk chunk;
    while (readers[static_cast<std::size_t>(k)]->Read(&chunk)) {
    }
    readers[static_cast<std::size_t>(k)]->Finish();
  }
}

SilentConnections::SilentConnections(const std::string& address, int number) {
  const std::size_t colon = address.rfind(':');
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1))));
  inet_pton(AF_INET, address.substr(0, colon).c_str(), &to.sin_addr);
  for (int k = 0; k < number; ++k) {
    const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (file < 0) return;
    files_.push_back(file);
    if (connect(file, reinterpret_cast<sockaddr*>(&to), sizeof(to)) != 0) return;
  }
}

SilentConnections::~SilentConnections() {
  for (const int file : files_) close(file);
}

}  // namespace calib::testing
