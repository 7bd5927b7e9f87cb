#pragma once
// A server stream whose messages are read from the store as they are sent.

#include <grpcpp/support/server_callback.h>

#include <functional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "server/service/calls.h"
#include "server/service/core.h"

namespace calib::service {

/// Loads some messages, writes them one after the other, and loads more once the peer has taken
/// them: no more than one load is in memory, however slow it reads. Deletes itself.
template <typename Message>
class StreamReactor final : public grpc::ServerWriteReactor<Message> {
 public:
  /// The next messages; none: that was all. Called on a pool, never twice at a time.
  using Load = std::function<absl::StatusOr<std::vector<Message>>()>;
  using Pool = void (Core::*)(std::function<void()>);

  StreamReactor(Core& core, Door::Pass pass, Pool pool, Load load)
      : core_(core), pass_(std::move(pass)), pool_(pool), load_(std::move(load)) {
    LoadNext();
  }

  void OnWriteDone(bool ok) override {
    if (!ok) {
      this->Finish(grpc::Status::CANCELLED);
    } else if (++next_ < messages_.size()) {
      this->StartWrite(&messages_[next_]);
    } else {
      LoadNext();
    }
  }

  void OnDone() override { delete this; }

 private:
  void LoadNext() {
    (core_.*pool_)([this] {
      messages_.clear();
      auto loaded = load_();
      absl::Status status = loaded.status();
      for (std::size_t k = 0; status.ok() && k < loaded->size(); ++k) {
        auto message = Outgoing(absl::StatusOr<Message>(std::move((*loaded)[k])));
        status = message.status();
        if (status.ok()) messages_.push_back(*std::move(message));
      }
      if (!status.ok() || messages_.empty()) {
        this->Finish(rpc::ToGrpc(status));
        return;
      }
      next_ = 0;
      this->StartWrite(messages_.data());
    });
  }

  Core& core_;
  const Door::Pass pass_;
  const Pool pool_;
  const Load load_;
  std::vector<Message> messages_;
  std::size_t next_ = 0;
};

/// A load of everything at once.
template <typename Message, typename Read>
typename StreamReactor<Message>::Load AtOnce(Read read) {
  return [read, done = false]() mutable -> absl::StatusOr<std::vector<Message>> {
    if (std::exchange(done, true)) {
      return std::vector<Message>();
    }
    return read();
  };
}

}  // namespace calib::service
