// What workers say: two streams of the service WorkerLink, through its door and the scheduler, over
// a store with a campaign of eight runs (service_under_fuzz.h), and what users do to it meanwhile.
// The attempts that are leased are 1, 2, ... in each input.
#include "server/service/worker_link_service.h"

#include <array>
#include <cmath>
#include <memory>

#include "calib/v1/campaign.pb.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/digest.h"
#include "tests/fuzz/call_sequence.h"
#include "tests/fuzz/direct_call.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/service_under_fuzz.h"

namespace calib::fuzz {
namespace {

using Stream = DirectStream<v1::WorkerMessage, v1::ServerMessage>;

/// What a call does, in the order of Methods().
enum What { kFirst, kSecond, kEndFirst, kCutFirst, kCutSecond, kGetBlob, kPause, kResume, kCancel };

void CheckSent(const v1::ServerMessage& message) {
  const absl::Status status = rpc::CheckMessage(message);
  Expect(status.ok(), "what a worker is sent keeps its rules: " + std::string(status.message()));
}

void CheckEnd(const grpc::Status& status) {
  Expect(status.ok() || !status.error_message().empty(), "a stream that ends says why");
  for (const auto code :
       {grpc::StatusCode::UNKNOWN, grpc::StatusCode::INTERNAL, grpc::StatusCode::DATA_LOSS}) {
    Expect(status.error_code() != code,
           "no message ends a stream by a fault of the server: " + status.error_message());
  }
}

/// "this" stands for what Hello has to say of the build, and a single value of a state for one of
/// each observable of the test, so that corpora outlive what these are.
void Resolve(v1::WorkerMessage& message) {
  if (message.has_states()) {
    static const std::size_t width = dem::FindTest("triaxial_drained")->observables.size();
    for (v1::State& state : *message.mutable_states()->mutable_states()) {
      if (state.values_size() != 1) continue;
      for (std::size_t k = 1; k < width; ++k) state.add_values(state.values(0));
    }
  }
  if (!message.has_hello()) return;
  static const std::string digest = rpc::Sha256Hex(dem::CatalogText());
  v1::Hello& hello = *message.mutable_hello();
  if (hello.engine_version() == "this") hello.set_engine_version(dem::EngineVersion());
  if (hello.catalog_digest() == "this") hello.set_catalog_digest(digest);
}

/// A worker, which connects with the first message that it says.
struct Worker {
  std::unique_ptr<Stream> stream{};
  std::unique_ptr<grpc::CallbackServerContext> context{};
};

class Link {
 public:
  Link() : service_(server_.core(), ServiceUnderFuzz::Folder()) {}
  ~Link() {
    for (Worker& worker : workers_) End(worker, false);
    server_.Settle();
  }
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// False: refused, or there was nothing to do.
  bool Do(What what, const google::protobuf::Message& message) {
    switch (what) {
      case kFirst:
      case kSecond:
        return Say(workers_[what == kFirst ? 0 : 1],
                   static_cast<const v1::WorkerMessage&>(message));
      case kEndFirst:
        return End(workers_[0], false);
      case kCutFirst:
      case kCutSecond:
        return End(workers_[what == kCutFirst ? 0 : 1], true);
      case kGetBlob: {
        auto request = static_cast<const v1::BlobRequest&>(message);
        request.set_digest(ServiceUnderFuzz::DigestOf(request.digest()));
        grpc::CallbackServerContext context;
        const grpc::Status status = DirectWriter<v1::BlobChunk>().Run(
            service_.GetBlob(&context, &request), 1000, [](const v1::BlobChunk& chunk) {
              Expect(rpc::CheckMessage(chunk).ok(), "a piece of a content keeps its rules");
            });
        CheckEnd(status);
        return status.ok();
      }
      case kPause:
      case kResume:
      case kCancel:
        return Control(what);
    }
    return false;
  }

 private:
  bool Say(Worker& worker, v1::WorkerMessage message) {
    Resolve(message);
    if (worker.stream == nullptr) {
      worker.context = std::make_unique<grpc::CallbackServerContext>();
      worker.stream = std::make_unique<Stream>(service_.Connect(worker.context.get()));
    }
    const bool taken = worker.stream->Say(&message, CheckSent);
    // What follows is sent before the next message comes, whatever the machine is busy with.
    server_.Settle();
    for (Worker& each : workers_) {
      if (each.stream != nullptr) each.stream->Hear(CheckSent);
    }
    if (!taken) End(worker, false);
    return taken;
  }

  bool End(Worker& worker, bool cut) {
    if (worker.stream == nullptr) return false;
    CheckEnd(worker.stream->End(cut, CheckSent));
    server_.Settle();
    worker.stream.reset();
    worker.context.reset();
    return true;
  }

  bool Control(What what) {
    bool done = false;
    const auto reply = [&done](const absl::Status& status) { done = status.ok(); };
    server_.OnStrand([&] {
      scheduler::Scheduler& scheduler = server_.core().scheduler();
      what == kPause    ? scheduler.Pause(1, {}, reply)
      : what == kResume ? scheduler.Resume(1, {}, reply)
                        : scheduler.Cancel(1, {}, reply);
    });
    server_.Settle();
    return done;
  }

  ServiceUnderFuzz server_;
  service::WorkerLinkService service_;
  std::array<Worker, 2> workers_;
};

}  // namespace

std::span<const Method> Methods() {
  static const auto* const says = &v1::WorkerMessage::default_instance();
  static const auto* const nothing = &v1::Leaving::default_instance();
  static const std::array<Method, 9> methods = {{{"first", says},
                                                 {"second", says},
                                                 {"end_first", nothing},
                                                 {"cut_first", nothing},
                                                 {"cut_second", nothing},
                                                 {"GetBlob", &v1::BlobRequest::default_instance()},
                                                 {"pause", nothing},
                                                 {"resume", nothing},
                                                 {"cancel", nothing}}};
  return methods;
}

}  // namespace calib::fuzz

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  const auto calls = CallsOf(TextOf(data, size));
  bool good = !calls.empty();
  Link link;
  for (const Call& call : calls) {
    const auto message = MessageOf(call);
    good = message != nullptr &&
           link.Do(static_cast<What>(call.method % Methods().size()), *message) && good;
  }
  last_was_good = good;
  return 0;
}
