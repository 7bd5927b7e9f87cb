#pragma once
// A server stream of messages that are all known when it begins.

#include <grpcpp/support/server_callback.h>

#include <functional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "proto/rpc/status.h"
#include "server/service/core.h"

namespace calib::service {

/// Loads the messages on the pool, then writes them one after the other. Deletes itself.
template <typename Message>
class StreamReactor final : public grpc::ServerWriteReactor<Message> {
 public:
  using Load = std::function<absl::StatusOr<std::vector<Message>>()>;

  StreamReactor(Core& core, Load load) {
    core.Query([this, load = std::move(load)] {
      auto loaded = load();
      if (!loaded.ok()) {
        this->Finish(rpc::ToGrpc(loaded.status()));
        return;
      }
      messages_ = *std::move(loaded);
      WriteNext();
    });
  }

  void OnWriteDone(bool ok) override {
    if (!ok) {
      this->Finish(grpc::Status::CANCELLED);
      return;
    }
    ++next_;
    WriteNext();
  }

  void OnDone() override { delete this; }

 private:
  void WriteNext() {
    if (next_ < messages_.size()) {
      this->StartWrite(&messages_[next_]);
    } else {
      this->Finish(grpc::Status::OK);
    }
  }

  std::vector<Message> messages_;
  std::size_t next_ = 0;
};

}  // namespace calib::service
