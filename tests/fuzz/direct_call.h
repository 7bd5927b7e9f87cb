#pragma once
// Calls of a service's reactors without a network: what gRPC's library does between a reactor and
// the wire, on the thread that calls. Reactions come one at a time, OnDone last.

#include <grpcpp/support/server_callback.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

namespace calib::fuzz {

/// What a reactor has asked for and not yet got. The reactor asks on any thread, the caller waits.
template <typename In, typename Out>
class Wishes {
 public:
  void Read(In* into) {
    Change([&] { read_ = into; });
  }
  void Write(const Out* message) {
    Change([&] { write_ = message; });
  }
  void Finish(grpc::Status status) {
    Change([&] { end_ = std::move(status); });
  }

  struct Wish {
    In* read = nullptr;
    const Out* write = nullptr;
    std::optional<grpc::Status> end{};
  };
  /// Waits for a message to send or the end or, where `reads`, a place to read into; takes what
  /// there is of these.
  Wish Take(bool reads) {
    std::unique_lock lock(mutex_);
    changed_.wait(
        lock, [&] { return write_ != nullptr || end_.has_value() || (reads && read_ != nullptr); });
    return Taken(reads);
  }
  /// The same of what is there now.
  Wish TakeNow(bool reads) {
    const std::lock_guard lock(mutex_);
    return Taken(reads);
  }

 private:
  template <typename F>
  void Change(const F& change) {
    const std::lock_guard lock(mutex_);
    change();
    changed_.notify_all();
  }
  Wish Taken(bool reads) {
    return {.read = reads ? std::exchange(read_, nullptr) : nullptr,
            .write = std::exchange(write_, nullptr),
            .end = end_};
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  In* read_ = nullptr;
  const Out* write_ = nullptr;
  std::optional<grpc::Status> end_;
};

struct Nothing {};

/// A call with one answer.
class DirectUnary final : public grpc::ServerCallbackUnary {
 public:
  /// Returns how it ended.
  grpc::Status Run(grpc::ServerUnaryReactor* reactor) {
    reactor_ = reactor;
    BindReactor(reactor);
    const auto end = *wishes_.Take(false).end;
    reactor->OnDone();
    return end;
  }

  void Finish(grpc::Status status) override { wishes_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}

 private:
  grpc::internal::ServerReactor* reactor() override { return reactor_; }
  void CallOnDone() override {}

  Wishes<Nothing, Nothing> wishes_;
  grpc::ServerUnaryReactor* reactor_ = nullptr;
};

/// A call that is answered with messages.
template <typename Out>
class DirectWriter final : public grpc::ServerCallbackWriter<Out> {
 public:
  /// At most so many messages are taken, each shown to `visit`; then the peer is gone.
  grpc::Status Run(grpc::ServerWriteReactor<Out>* reactor, int most,
                   const std::function<void(const Out&)>& visit) {
    reactor_ = reactor;
    this->BindReactor(reactor);
    bool gone = false;
    for (;;) {
      const auto wish = wishes_.Take(false);
      if (wish.write != nullptr) {
        if (!gone) visit(*wish.write);
        if (--most == 0 && !wish.end.has_value()) {
          gone = true;
          reactor->OnCancel();
        }
        reactor->OnWriteDone(!gone);
      }
      if (wish.end.has_value()) {
        reactor->OnDone();
        return *wish.end;
      }
    }
  }

  void Finish(grpc::Status status) override { wishes_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}
  void Write(const Out* message, grpc::WriteOptions /*options*/) override {
    wishes_.Write(message);
  }
  void WriteAndFinish(const Out* message, grpc::WriteOptions /*options*/,
                      grpc::Status status) override {
    wishes_.Write(message);
    wishes_.Finish(std::move(status));
  }

 private:
  grpc::internal::ServerReactor* reactor() override { return reactor_; }
  void CallOnDone() override {}

  Wishes<Nothing, Out> wishes_;
  grpc::ServerWriteReactor<Out>* reactor_ = nullptr;
};

/// A call that brings messages and has one answer.
template <typename In>
class DirectReader final : public grpc::ServerCallbackReader<In> {
 public:
  /// next: fills the message that comes now; false: there is none.
  grpc::Status Run(grpc::ServerReadReactor<In>* reactor, const std::function<bool(In&)>& next) {
    reactor_ = reactor;
    this->BindReactor(reactor);
    for (;;) {
      const auto wish = wishes_.Take(true);
      if (wish.read != nullptr) {
        reactor->OnReadDone(!wish.end.has_value() && next(*wish.read));
      }
      if (wish.end.has_value()) {
        reactor->OnDone();
        return *wish.end;
      }
    }
  }

  void Finish(grpc::Status status) override { wishes_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}
  void Read(In* into) override { wishes_.Read(into); }

 private:
  grpc::internal::ServerReactor* reactor() override { return reactor_; }
  void CallOnDone() override {}

  Wishes<In, Nothing> wishes_;
  grpc::ServerReadReactor<In>* reactor_ = nullptr;
};

/// A stream both ways.
template <typename In, typename Out>
class DirectStream final : public grpc::ServerCallbackReaderWriter<In, Out> {
 public:
  using Visit = std::function<void(const Out&)>;

  explicit DirectStream(grpc::ServerBidiReactor<In, Out>* reactor) : reactor_(reactor) {
    this->BindReactor(reactor);
  }

  /// Gives the reactor a message once it asks for one; what it sends meanwhile is shown to `visit`.
  /// False: the stream has ended, or the message is the last (nullptr).
  bool Say(const In* message, const Visit& visit) {
    for (;;) {
      const auto wish = wishes_.Take(true);
      if (wish.write != nullptr) {
        visit(*wish.write);
        reactor_->OnWriteDone(true);
      }
      if (wish.read != nullptr) {
        const bool comes = message != nullptr && !wish.end.has_value();
        if (comes) *wish.read = *message;
        reactor_->OnReadDone(comes);
        if (comes) return true;
        message = nullptr;  // whatever it asks for later, that was all
      }
      if (wish.end.has_value()) {
        end_ = wish.end;
        return false;
      }
    }
  }
  /// Shows what the reactor sends now.
  void Hear(const Visit& visit) {
    for (auto wish = wishes_.TakeNow(false); wish.write != nullptr; wish = wishes_.TakeNow(false)) {
      visit(*wish.write);
      reactor_->OnWriteDone(true);
    }
  }
  /// cut: as when the connection is lost; else the peer has said all. Returns how it ended.
  grpc::Status End(bool cut, const Visit& visit) {
    if (cut && !end_.has_value()) reactor_->OnCancel();
    if (!end_.has_value()) Say(nullptr, visit);
    if (const auto wish = wishes_.TakeNow(true); wish.read != nullptr) reactor_->OnReadDone(false);
    reactor_->OnDone();
    return *end_;
  }

  void Finish(grpc::Status status) override { wishes_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}
  void Read(In* into) override { wishes_.Read(into); }
  void Write(const Out* message, grpc::WriteOptions /*options*/) override {
    wishes_.Write(message);
  }
  void WriteAndFinish(const Out* message, grpc::WriteOptions /*options*/,
                      grpc::Status status) override {
    wishes_.Write(message);
    wishes_.Finish(std::move(status));
  }

 private:
  grpc::internal::ServerReactor* reactor() override { return reactor_; }
  void CallOnDone() override {}

  Wishes<In, Out> wishes_;
  grpc::ServerBidiReactor<In, Out>* reactor_ = nullptr;
  std::optional<grpc::Status> end_;
};

}  // namespace calib::fuzz
