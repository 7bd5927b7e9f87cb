#include "server/service/worker_link_service.h"

#include <grpcpp/support/server_callback.h>
#include <spdlog/spdlog.h>

#include <deque>
#include <optional>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "proto/rpc/status.h"
#include "server/service/blob_stream.h"

namespace calib::service {
namespace {

/// One worker's stream. The next message is read when the strand has taken the one before, so that
/// a fast worker cannot fill the server's memory. Known to the strand (Core's sessions) from its
/// first message until OnDone.
class WorkerStream final : public grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>,
                           public Session {
 public:
  explicit WorkerStream(Core& core) : core_(core) {
    core_.Post([this] { session_ = core_.AddSession(this); });
    StartRead(&incoming_);
  }

  // ---- reactions ----

  void OnReadDone(bool ok) override {
    if (!ok) {
      Close(absl::OkStatus());  // the worker has said all it had to say, or is gone
      return;
    }
    core_.Post([this] {
      const absl::Status status = core_.health().ok() ? Take() : Down();
      if (!status.ok()) {
        spdlog::warn("worker_refused session={} reason=\"{}\"", session_,
                     std::string(status.message()));
        Close(status);
        return;
      }
      // Once the end is decided Finish may have been called, and after it OnDone: the call is then
      // no longer gRPC's to read from.
      absl::MutexLock lock(&mutex_);
      if (!end_.has_value()) {
        StartRead(&incoming_);
      }
    });
  }

  void OnWriteDone(bool ok) override {
    absl::MutexLock lock(&mutex_);
    writing_ = false;
    outgoing_.pop_front();
    if (!ok) {
      outgoing_.clear();
      end_ = end_.value_or(absl::OkStatus());
    }
    Proceed();
  }

  void OnCancel() override { Close(absl::CancelledError("the stream was cut")); }

  void OnDone() override {
    core_.Post([this] {
      if (!name_.empty()) {
        spdlog::info("worker_disconnected name={} session={}", name_, session_);
      }
      core_.RemoveSession(session_);
      delete this;
    });
  }

  // ---- Session ----

  void Send(v1::ServerMessage message) override {
    absl::MutexLock lock(&mutex_);
    if (!end_.has_value()) {
      outgoing_.push_back(std::move(message));
      Proceed();
    }
  }

  void Close(const absl::Status& status) override {
    absl::MutexLock lock(&mutex_);
    if (!end_.has_value()) {
      end_ = status;
      if (!status.ok() && !outgoing_.empty()) {
        // A peer that has stopped reading must not keep the stream open: what is not on its way is
        // dropped.
        outgoing_.resize(writing_ ? 1 : 0);
      }
      Proceed();
    }
  }

 private:
  /// On the strand: why no work is taken.
  absl::Status Down() const { return absl::UnavailableError(core_.health().message()); }

  /// On the strand: what a message means.
  absl::Status Take() {
    scheduler::Scheduler& scheduler = core_.scheduler();
    const v1::WorkerMessage message = std::exchange(incoming_, {});
    if (name_.empty()) {
      if (!message.has_hello()) {
        return absl::InvalidArgumentError("the first message must be Hello");
      }
      RETURN_IF_ERROR(scheduler.Connected(session_, message.hello()));
      name_ = message.hello().name();
      spdlog::info("worker_connected name={} session={} slots={} held={}", name_, session_,
                   message.hello().slots(), message.hello().attempts_size());
      return absl::OkStatus();
    }
    switch (message.message_case()) {
      case v1::WorkerMessage::kStates:
        scheduler.Receive(session_, message.states());
        break;
      case v1::WorkerMessage::kFinished:
        scheduler.Receive(session_, message.finished());
        break;
      case v1::WorkerMessage::kHeartbeat:
        scheduler.Receive(session_, message.heartbeat());
        break;
      case v1::WorkerMessage::kLeaving:
        scheduler.Receive(session_, message.leaving());
        break;
      case v1::WorkerMessage::kHello:
        return absl::InvalidArgumentError("only the first message may be Hello");
      case v1::WorkerMessage::MESSAGE_NOT_SET:
        return absl::InvalidArgumentError("an empty message");
    }
    return absl::OkStatus();
  }

  void Proceed() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (writing_ || finished_) {
      return;
    }
    if (!outgoing_.empty()) {
      writing_ = true;
      StartWrite(&outgoing_.front());
    } else if (end_.has_value()) {
      finished_ = true;
      Finish(rpc::ToGrpc(*end_));
    }
  }

  Core& core_;
  v1::WorkerMessage incoming_;  // gRPC's while a read is in flight, else the strand's
  std::int64_t session_ = 0;    // the strand's
  std::string name_;            // the strand's; empty before Hello
  absl::Mutex mutex_;
  std::deque<v1::ServerMessage> outgoing_ ABSL_GUARDED_BY(mutex_);  // front: being written
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> end_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>* WorkerLinkService::Connect(
    grpc::CallbackServerContext* /*context*/) {
  return new WorkerStream(core_);
}

grpc::ServerWriteReactor<v1::BlobChunk>* WorkerLinkService::GetBlob(
    grpc::CallbackServerContext* /*context*/, const v1::BlobRequest* request) {
  return SendBlob(core_, request->digest());
}

}  // namespace calib::service
