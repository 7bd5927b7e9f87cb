// load_null: a server that leases and acknowledges and does nothing else. What `load` measures at
// it is what streams and messages cost by themselves. Prints its address, ends with its input.
#include <grpcpp/grpcpp.h>

#include <CLI/CLI.hpp>
#include <deque>
#include <iostream>
#include <mutex>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/v1/worker.grpc.pb.h"

namespace {

namespace v1 = calib::v1;

struct Options {
  int port = 0;
  int states = 100;     // of a run
  int gather_ms = 150;  // as calibd's
};

/// One worker's stream. Its slots always hold a run each; what comes is acknowledged at once.
class Stream final : public grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage> {
 public:
  explicit Stream(const Options& options) : options_(options) { StartRead(&incoming_); }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    if (!ok) {
      ended_ = true;
      Proceed();
      return;
    }
    Take();
    StartRead(&incoming_);
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    outgoing_.pop_front();
    if (!ok) {
      ended_ = true;
      outgoing_.clear();
    }
    Proceed();
  }

  void OnDone() override { delete this; }

 private:
  void Take() {
    v1::ServerMessage answer;
    if (incoming_.has_hello()) {
      answer.mutable_welcome()->set_heartbeat_ms(2000);
      answer.mutable_welcome()->set_lease_ms(15'000);
      answer.mutable_welcome()->set_gather_ms(options_.gather_ms);
      Send(std::move(answer));
      for (int slot = 0; slot < incoming_.hello().slots(); ++slot) Lease();
    } else if (incoming_.has_gathered()) {
      for (const v1::StateBatch& batch : incoming_.gathered().batches()) {
        Acknowledge(batch, *answer.mutable_acks()->add_acks());
      }
      Send(std::move(answer));
    } else if (incoming_.has_states()) {
      Acknowledge(incoming_.states(), *answer.mutable_ack());
      Send(std::move(answer));
    } else if (incoming_.has_finished()) {
      answer.mutable_ack()->set_attempt(incoming_.finished().attempt());
      answer.mutable_ack()->set_up_to(incoming_.finished().states());
      answer.mutable_ack()->set_finished(true);
      Send(std::move(answer));
      Lease();
    }
  }

  static void Acknowledge(const v1::StateBatch& batch, v1::Ack& ack) {
    ack.set_attempt(batch.attempt());
    ack.set_up_to(batch.first() + batch.states_size());
  }

  void Lease() {
    v1::ServerMessage message;
    v1::Lease& lease = *message.mutable_lease();
    lease.set_attempt(++attempts_);
    lease.mutable_spec()->set_test("collision");
    for (int k = 0; k < options_.states; ++k) {
      lease.mutable_spec()->add_path()->set_load_step(k);
    }
    Send(std::move(message));
  }

  void Send(v1::ServerMessage message) {
    outgoing_.push_back(std::move(message));
    Proceed();
  }

  void Proceed() {
    if (writing_ || finished_) return;
    if (!outgoing_.empty()) {
      writing_ = true;
      StartWrite(&outgoing_.front());
    } else if (ended_) {
      finished_ = true;
      Finish(grpc::Status::OK);
    }
  }

  const Options options_;
  v1::WorkerMessage incoming_;
  std::mutex mutex_;
  std::deque<v1::ServerMessage> outgoing_;  // the first is being written
  std::int64_t attempts_ = 0;
  bool writing_ = false;
  bool ended_ = false;
  bool finished_ = false;
};

class Service final : public v1::WorkerLink::CallbackService {
 public:
  explicit Service(Options options) : options_(options) {}
  grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>* Connect(
      grpc::CallbackServerContext* /*context*/) override {
    return new Stream(options_);
  }

 private:
  const Options options_;
};

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CLI::App app("A server that only acknowledges: what streams and messages cost by themselves");
  app.add_option("--port", o.port, "0: a free one")->check(CLI::Range(0, 65535));
  app.add_option("--states", o.states, "of a run")->check(CLI::Range(1, 1000));
  app.add_option("--gather-ms", o.gather_ms)->check(CLI::Range(0, 10000));
  CLI11_PARSE(app, argc, argv);
  Service service(o);
  grpc::ServerBuilder builder;
  builder.AddListeningPort(absl::StrCat("127.0.0.1:", o.port), grpc::InsecureServerCredentials(),
                           &o.port);
  builder.RegisterService(&service);
  const auto server = builder.BuildAndStart();
  if (server == nullptr) {
    std::cerr << "load_null: cannot listen at port " << o.port << "\n";
    return 1;
  }
  std::cout << "127.0.0.1:" << o.port << std::endl;
  while (std::cin.get() != EOF) {
  }
  server->Shutdown(std::chrono::system_clock::now());
  return 0;
}
