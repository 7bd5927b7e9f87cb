#pragma once
// What the streams that tell of changes have in common.

#include <grpcpp/support/server_callback.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>

#include "absl/status/status.h"
#include "proto/rpc/status.h"
#include "server/service/calls.h"

namespace calib::service {

/// A stream that goes round: look, write, wait until something has changed. Deletes itself. Made by
/// gRPC's threads; all else happens on the strand, but what a Look() hands to the pool.
template <typename Message>
class Watcher : public grpc::ServerWriteReactor<Message> {
 public:
  /// between: at least, from one message to the next.
  Watcher(Core& core, Entry entry, std::chrono::milliseconds between)
      : core_(core), entry_(std::move(entry)), between_(between), timer_(core.strand()) {}

  void OnWriteDone(bool ok) override {
    core_.Post([this, ok] {
      if (!ok) {
        this->Finish(grpc::Status::CANCELLED);
      } else if (IsLast()) {
        this->Finish(grpc::Status::OK);
      } else {
        Wait();
      }
    });
  }

  void OnCancel() override {
    core_.Post([this] {
      cancelled_ = true;
      timer_.cancel();
    });
  }

  void OnDone() override {
    // OnCancel comes before OnDone, so what it posted to the strand has run when this does.
    core_.Post([this] { delete this; });
  }

 protected:
  /// Fills message_ and writes it, or finishes. On the strand, when seen_ is the core's version.
  virtual void Fill() = 0;
  /// Whether message_, which was written, is the last.
  virtual bool IsLast() const { return false; }

  void Begin() {
    core_.Post([this] { Look(); });
  }

  /// Why the stream ends; OK: it goes on. A caller that may not stay is logged.
  absl::Status WhyEnd() {
    if (cancelled_) return absl::CancelledError("");
    if (!core_.health().ok()) return core_.health();
    absl::Status welcome = core_.guard().Recheck(entry_.caller);
    if (!welcome.ok()) core_.door().LogRefusal(entry_.caller.peer, welcome);
    return welcome;
  }

  Core& core_;
  Message message_;

 private:
  void Wait() {
    timer_.expires_after(between_);
    timer_.async_wait([this](const boost::system::error_code& /*error*/) {
      if (!cancelled_ && core_.health().ok() && core_.version() == seen_ &&
          core_.guard().Recheck(entry_.caller).ok()) {
        Wait();
      } else {
        Look();
      }
    });
  }

  void Look() {
    if (const absl::Status end = WhyEnd(); !end.ok()) {
      this->Finish(rpc::ToGrpc(end));
      return;
    }
    seen_ = core_.version();
    Fill();
  }

  const Entry entry_;
  const std::chrono::milliseconds between_;
  boost::asio::steady_timer timer_;
  std::uint64_t seen_ = 0;
  bool cancelled_ = false;
};

}  // namespace calib::service
