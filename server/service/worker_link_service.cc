#include "server/service/worker_link_service.h"

#include <grpcpp/support/server_callback.h>
#include <spdlog/spdlog.h>

#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/status.h"
#include "server/service/blob_stream.h"
#include "server/service/calls.h"

namespace calib::service {
namespace {

/// What a stream may have said and not yet on disk [bytes, messages], so that a fast worker cannot
/// fill the queue of the store; and what it may be sent and not yet have taken [messages], before
/// nothing more is read from it, and before the stream ends. Chosen: some seconds of a node with
/// hundreds of slots, and a few MB of a server with hundreds of nodes.
constexpr std::size_t kUnwrittenBytes = std::size_t{256} * 1024;
constexpr int kUnwrittenMessages = 64;
constexpr std::size_t kUntaken = 256;
constexpr std::size_t kMostUntaken = 8192;

/// The run that a message is about; 0: of none.
std::int64_t AttemptOf(const v1::WorkerMessage& message) {
  return message.has_states()     ? message.states().attempt()
         : message.has_finished() ? message.finished().attempt()
                                  : 0;
}

/// One worker's stream. The next message is read when the strand has taken the one before, what
/// they led to is on its way to the disk and not much of it, and the worker has taken what it was
/// sent. Known to the strand (Core's sessions) from its first message until OnDone.
class WorkerStream final : public grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>,
                           public Session {
 public:
  WorkerStream(Core& core, std::string peer, Entry entry)
      : core_(core), peer_(std::move(peer)), entry_(std::move(entry)) {
    core_.Post([this] { session_ = core_.AddSession(this); });
    StartRead(&incoming_);
  }

  // ---- reactions ----

  void OnReadDone(bool ok) override {
    if (!ok) {
      Close(absl::OkStatus());  // the worker has said all it had to say, or is gone
      return;
    }
    core_.Post([this, welcome = core_.guard().Recheck(entry_.caller),
                broken = core_.door().Check(peer_, incoming_)] {
      const absl::Status status = !core_.health().ok() ? Down()
                                  : !welcome.ok()      ? welcome
                                                       : Take(broken);
      if (status.ok()) {
        ReadOn();
        return;
      }
      core_.door().LogRefusal(peer_, status);
      Close(status);
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
    Read();
  }

  void OnCancel() override { Close(absl::CancelledError("the stream was cut")); }

  void OnDone() override {
    core_.Post([this] {
      if (!name_.empty()) {
        spdlog::info("worker_disconnected name={} session={}", name_, session_);
      }
      core_.RemoveSession(session_);
      is_done_ = true;
      if (!awaits_disk_) {
        delete this;
      }
    });
  }

  // ---- Session ----

  void Send(v1::ServerMessage message) override {
    absl::MutexLock lock(&mutex_);
    if (!end_.has_value()) {
      outgoing_.push_back(std::move(message));
      if (outgoing_.size() > kMostUntaken) {
        End(absl::ResourceExhaustedError("the worker does not read what it is sent"));
      }
      Proceed();
    }
  }

  void Close(const absl::Status& status) override {
    absl::MutexLock lock(&mutex_);
    if (!end_.has_value()) {
      End(status);
      Proceed();
    }
  }

 private:
  /// On the strand: why no work is taken.
  absl::Status Down() const { return absl::UnavailableError(core_.health().message()); }

  /// On the strand: what a message means. broken: the rule that it breaks. One about a run fails
  /// that attempt, not the worker: the next that is leased it would say the same.
  absl::Status Take(const absl::Status& broken) {
    scheduler::Scheduler& scheduler = core_.scheduler();
    const v1::WorkerMessage message = std::exchange(incoming_, {});
    unwritten_bytes_ += message.ByteSizeLong();
    ++unwritten_messages_;
    if (!broken.ok() && message.has_gathered() && !name_.empty()) {
      return TakeOneByOne(message.gathered());
    }
    if (!broken.ok()) {
      v1::Ack answer;  // what it says of an attempt is answered, if it can be one at all
      answer.set_attempt(AttemptOf(message));
      if (name_.empty() || !rpc::CheckMessage(answer).ok()) {
        return broken;
      }
      scheduler.Reject(session_, answer.attempt(), std::string(broken.message()));
      return absl::OkStatus();
    }
    if (name_.empty()) {
      if (!message.has_hello()) {
        return absl::InvalidArgumentError("the first message must be Hello");
      }
      RETURN_IF_ERROR(scheduler.Connected(session_, message.hello()));
      name_ = message.hello().name();
      spdlog::info("worker_connected name={} session={} slots={} held={} by={} role={}", name_,
                   session_, message.hello().slots(), message.hello().attempts_size(),
                   entry_.caller.name, access::NameOf(entry_.caller.role));
      return absl::OkStatus();
    }
    switch (message.message_case()) {
      case v1::WorkerMessage::kStates:
        scheduler.Receive(session_, message.states());
        break;
      case v1::WorkerMessage::kGathered:
        scheduler.Receive(session_, message.gathered());
        break;
      case v1::WorkerMessage::kFinished:
        scheduler.Receive(session_, message.finished());
        break;
      case v1::WorkerMessage::kHeartbeat:
        return scheduler.Receive(session_, message.heartbeat());
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

  /// On the strand: the batches of a message that breaks a rule; those that keep them all count.
  absl::Status TakeOneByOne(const v1::StateBatches& gathered) {
    for (const v1::StateBatch& batch : gathered.batches()) {
      v1::Ack answer;
      answer.set_attempt(batch.attempt());
      RETURN_IF_ERROR(rpc::CheckMessage(answer));
      if (const absl::Status kept = rpc::CheckMessage(batch); kept.ok()) {
        core_.scheduler().Receive(session_, batch);
      } else {
        core_.scheduler().Reject(session_, batch.attempt(), std::string(kept.message()));
      }
    }
    return absl::OkStatus();
  }

  /// On the strand, after a message was taken: the next one, once what they led to is on disk where
  /// that is much.
  void ReadOn() {
    if (unwritten_bytes_ <= kUnwrittenBytes && unwritten_messages_ < kUnwrittenMessages) {
      MayRead();
      return;
    }
    unwritten_bytes_ = 0;
    unwritten_messages_ = 0;
    awaits_disk_ = true;
    core_.Write([](store::Transaction&) {},
                [this](const absl::Status& /*written*/) {
                  awaits_disk_ = false;
                  if (is_done_) {
                    delete this;
                  } else {
                    MayRead();
                  }
                });
  }

  void MayRead() {
    absl::MutexLock lock(&mutex_);
    may_read_ = true;
    Read();
  }

  // Once the end is decided Finish may have been called, and after it OnDone: the call is then no
  // longer gRPC's to read from.
  void Read() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (may_read_ && !end_.has_value() && outgoing_.size() <= kUntaken) {
      may_read_ = false;
      StartRead(&incoming_);
    }
  }

  void End(const absl::Status& status) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    end_ = status;
    if (!status.ok() && !outgoing_.empty()) {
      // A peer that has stopped reading must not keep the stream open: what is not on its way is
      // dropped.
      outgoing_.resize(writing_ ? 1 : 0);
    }
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
  const std::string peer_;
  const Entry entry_;
  v1::WorkerMessage incoming_;  // gRPC's while a read is in flight, else the strand's
  // The strand's.
  std::int64_t session_ = 0;
  std::string name_;                 // empty before Hello
  std::size_t unwritten_bytes_ = 0;  // since the disk was last awaited
  int unwritten_messages_ = 0;
  bool awaits_disk_ = false;
  bool is_done_ = false;
  absl::Mutex mutex_;
  std::deque<v1::ServerMessage> outgoing_ ABSL_GUARDED_BY(mutex_);  // front: being written
  bool may_read_ ABSL_GUARDED_BY(mutex_) = false;  // no read is in flight, one may begin
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> end_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>* WorkerLinkService::Connect(
    grpc::CallbackServerContext* context) {
  auto entry = Admit(core_, *context, Right::kWork, nullptr);
  if (!entry.ok()) {
    return new EndedCall<grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>>(
        entry.status());
  }
  return new WorkerStream(core_, context->peer(), *std::move(entry));
}

grpc::ServerWriteReactor<v1::BlobChunk>* WorkerLinkService::GetBlob(
    grpc::CallbackServerContext* context, const v1::BlobRequest* request) {
  return SendBlob(core_, *context, Right::kWork, *request, request->digest());
}

grpc::ServerReadReactor<v1::BlobChunk>* WorkerLinkService::PutBlob(
    grpc::CallbackServerContext* context, v1::BlobReceipt* reply) {
  return ReceiveBlob(core_, *context, Right::kWork, state_folder_, reply);
}

}  // namespace calib::service
