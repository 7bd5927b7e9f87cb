// What a server answers to programs that know nothing of it: grpc.health.v1 and reflection.
#include <gmock/gmock.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "server/service/server.h"

namespace calib::service {
namespace {

using ::testing::HasSubstr;

/// Calls without knowledge of any message: bytes there and back.
class Bytes {
 public:
  explicit Bytes(const std::shared_ptr<grpc::Channel>& channel) : stub_(channel) {}

  /// The first answer to one message; empty: there was none.
  std::string Ask(const std::string& method, const std::string& message) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    const auto call = stub_.PrepareCall(&context, method, &queue_);
    call->StartCall(Tag());
    bool ok = Done();
    const grpc::Slice slice(message);
    if (ok) {
      call->Write(grpc::ByteBuffer(&slice, 1), Tag());
      ok = Done();
    }
    grpc::ByteBuffer answer;
    if (ok) {
      call->Read(&answer, Tag());
      ok = Done();
    }
    call->WritesDone(Tag());
    Done();
    grpc::Status status;
    context.TryCancel();
    call->Finish(&status, Tag());
    Done();
    std::vector<grpc::Slice> slices;
    std::string text;
    if (ok && answer.Dump(&slices).ok()) {
      for (const grpc::Slice& one : slices) {
        text.append(reinterpret_cast<const char*>(one.begin()), one.size());
      }
    }
    return text;
  }

 private:
  static void* Tag() { return reinterpret_cast<void*>(1); }
  bool Done() {
    void* tag = nullptr;
    bool ok = false;
    return queue_.Next(&tag, &ok) && ok;
  }

  grpc::GenericStub stub_;
  grpc::CompletionQueue queue_;
};

TEST(Health, IsToldOfAllAndOfEachServiceToWhoeverAsks) {
  const std::string folder = ::testing::TempDir() + "/health";
  std::filesystem::remove_all(folder);
  const auto server = Server::Start({.state_dir = folder, .log_file = folder + ".log"});
  ASSERT_TRUE(server.ok()) << server.status();
  const std::string kServing = "\x08\x01";  // HealthCheckResponse {status: SERVING}
  Bytes peer((*server)->InProcessChannel());
  EXPECT_EQ(peer.Ask("/grpc.health.v1.Health/Check", ""), kServing);
  const std::string service = "calib.v1.Campaigns";
  EXPECT_EQ(peer.Ask("/grpc.health.v1.Health/Check",
                     "\x0a" + std::string(1, static_cast<char>(service.size())) + service),
            kServing);
  EXPECT_EQ(peer.Ask("/grpc.health.v1.Health/Check", "\x0a\x01x"), "") << "nobody knows it";
  const std::string services = peer.Ask(
      "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", std::string("\x3a\x00", 2));
  for (const char* name : {"calib.v1.Campaigns", "calib.v1.WorkerLink", "grpc.health.v1.Health"}) {
    EXPECT_THAT(services, HasSubstr(name));
  }
}

}  // namespace
}  // namespace calib::service
