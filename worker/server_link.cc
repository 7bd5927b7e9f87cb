#include "worker/server_link.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/client_callback.h>

#include <condition_variable>
#include <deque>
#include <functional>
#include <limits>
#include <mutex>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "calib/v1/worker.grpc.pb.h"
#include "proto/rpc/backoff.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/shown_access.h"
#include "proto/rpc/status.h"

namespace calib::worker {

/// One stream. Lives until OnDone, which hands its end to the link.
class ServerLink::Stream final
    : public grpc::ClientBidiReactor<v1::WorkerMessage, v1::ServerMessage> {
 public:
  Stream(std::shared_ptr<v1::WorkerLink::Stub> stub, const LinkEvents& events,
         std::function<void()> done)
      : stub_(std::move(stub)), events_(events), done_(std::move(done)) {
    stub_->async()->Connect(&context_, this);
    AddHold();  // Send() starts writes outside of reactions until the first failed read
    StartRead(&incoming_);
    StartCall();
  }

  void Send(v1::WorkerMessage message) {
    absl::MutexLock lock(&mutex_);
    if (closed_ || finishing_) {
      return;
    }
    outgoing_.push_back(std::move(message));
    WriteNext();
  }

  void FinishSending() {
    absl::MutexLock lock(&mutex_);
    if (!closed_ && !finishing_) {
      finishing_ = true;
      WriteNext();
    }
  }

  void Cancel() { context_.TryCancel(); }

  void OnReadDone(bool ok) override {
    if (ok) {
      events_.received(std::move(incoming_));
      incoming_.Clear();
      StartRead(&incoming_);
      return;
    }
    {
      absl::MutexLock lock(&mutex_);
      closed_ = true;
    }
    RemoveHold();
  }

  void OnWriteDone(bool ok) override {
    absl::MutexLock lock(&mutex_);
    writing_ = false;
    outgoing_.pop_front();
    if (ok && !closed_) {
      WriteNext();
    }
  }

  void OnDone(const grpc::Status& status) override {
    events_.closed(rpc::FromGrpc(status));
    const auto done = done_;  // destroys this stream
    done();
  }

 private:
  void WriteNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (writing_) {
      return;
    }
    if (!outgoing_.empty()) {
      writing_ = true;
      StartWrite(&outgoing_.front());
    } else if (finishing_ && !finished_) {
      finished_ = true;
      StartWritesDone();
    }
  }

  const std::shared_ptr<v1::WorkerLink::Stub> stub_;
  const LinkEvents& events_;
  const std::function<void()> done_;
  grpc::ClientContext context_;
  v1::ServerMessage incoming_;
  absl::Mutex mutex_;
  std::deque<v1::WorkerMessage> outgoing_ ABSL_GUARDED_BY(mutex_);  // front: being written
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

struct ServerLink::Impl {
  Impl(std::string server, rpc::AccessChoice access_choice, LinkEvents link_events)
      : address(std::move(server)),
        choice(std::move(access_choice)),
        events{
            .received = std::move(link_events.received),
            .closed = [this, closed = std::move(link_events.closed)](const absl::Status& status) {
              if (absl::IsUnauthenticated(status)) {
                absl::MutexLock lock(&mutex);
                was_not_let_in = true;
              }
              closed(status);
            }} {}

  bool HasNoStream() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) { return stream == nullptr; }

  /// The connection, made where there is none.
  absl::StatusOr<std::shared_ptr<v1::WorkerLink::Stub>> Connection()
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) {
    if (stub == nullptr) {
      ASSIGN_OR_RETURN(shown, rpc::FindShownAccess(address, choice));
      stub = v1::WorkerLink::NewStub(rpc::OpenChannel(address, shown.access));
    }
    return stub;
  }

  absl::StatusOr<std::shared_ptr<v1::WorkerLink::Stub>> OpenStub() {
    absl::MutexLock lock(&mutex);
    return Connection();
  }

  const std::string address;
  const rpc::AccessChoice choice;
  absl::Mutex mutex;
  /// With its channel, which must not go on a thread of gRPC's.
  std::shared_ptr<v1::WorkerLink::Stub> stub ABSL_GUARDED_BY(mutex);
  rpc::ShownAccess shown ABSL_GUARDED_BY(mutex);       // over this connection
  bool was_not_let_in ABSL_GUARDED_BY(mutex) = false;  // over this connection
  std::unique_ptr<Stream> stream ABSL_GUARDED_BY(mutex);
  const LinkEvents events;
};

ServerLink::ServerLink(std::string address, rpc::AccessChoice access, LinkEvents events)
    : impl_(std::make_unique<Impl>(std::move(address), std::move(access), std::move(events))) {}

ServerLink::~ServerLink() {
  absl::MutexLock lock(&impl_->mutex);
  if (impl_->stream != nullptr) {
    impl_->stream->Cancel();
  }
  impl_->mutex.Await(absl::Condition(impl_.get(), &Impl::HasNoStream));
}

absl::Status ServerLink::Open(const v1::Hello& hello) {
  absl::MutexLock lock(&impl_->mutex);
  // The stream before has reported its end but may still be on its way out.
  impl_->mutex.Await(absl::Condition(impl_.get(), &Impl::HasNoStream));
  if (std::exchange(impl_->was_not_let_in, false)) {
    impl_->stub.reset();
  }
  ASSIGN_OR_RETURN(const auto stub, impl_->Connection());
  impl_->stream = std::make_unique<Stream>(stub, impl_->events, [impl = impl_.get()] {
    absl::MutexLock relock(&impl->mutex);
    impl->stream.reset();
  });
  v1::WorkerMessage message;
  *message.mutable_hello() = hello;
  impl_->stream->Send(std::move(message));
  return absl::OkStatus();
}

void ServerLink::Send(v1::WorkerMessage message) {
  absl::MutexLock lock(&impl_->mutex);
  if (impl_->stream != nullptr) {
    impl_->stream->Send(std::move(message));
  }
}

void ServerLink::FinishSending() {
  absl::MutexLock lock(&impl_->mutex);
  if (impl_->stream != nullptr) {
    impl_->stream->FinishSending();
  }
}

bool ServerLink::HasMoreToShow() {
  const auto now = rpc::FindShownAccess(impl_->address, impl_->choice);
  absl::MutexLock lock(&impl_->mutex);
  return now.ok() && *now != impl_->shown;
}

namespace {

/// Of a content that is to be stored: the server may be out of room for long, or take none as
/// large.
constexpr int kMostRefusals = 5;

/// Calls until an answer will not change, or `stop`; not more often than `most_refusals` where the
/// server has no room. call: one try, its status that of gRPC.
absl::Status Insist(const std::stop_token& stop, int most_refusals,
                    const std::function<absl::Status(grpc::ClientContext&)>& call) {
  rpc::Backoff backoff({});
  for (int refusals = 0;;) {
    grpc::ClientContext context;
    rpc::SetDeadline(context, rpc::kBlobDeadline);
    const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
    absl::Status status = call(context);
    refusals += absl::IsResourceExhausted(status) ? 1 : 0;
    // Cancelled without a stop: by a server that ends.
    const bool may_change = rpc::IsRetryable(status.code()) || absl::IsCancelled(status);
    if (status.ok() || stop.stop_requested() || !may_change || refusals >= most_refusals) {
      return status;
    }
    std::mutex mutex;
    std::unique_lock<std::mutex> lock(mutex);
    std::condition_variable_any().wait_for(lock, stop, backoff.Next(), [] { return false; });
  }
}

}  // namespace

absl::StatusOr<std::string> ServerLink::GetBlob(const std::string& digest, std::stop_token stop) {
  v1::BlobRequest request;
  request.set_digest(digest);
  std::string content;
  const auto fetch = [&](grpc::ClientContext& context) -> absl::Status {
    ASSIGN_OR_RETURN(const auto stub, impl_->OpenStub());
    const auto reader = stub->GetBlob(&context, request);
    rpc::BlobAssembler assembler;
    v1::BlobChunk chunk;
    absl::Status assembled;
    while (assembled.ok() && reader->Read(&chunk)) {
      assembled = rpc::CheckMessage(chunk);
      if (assembled.ok()) assembled = assembler.Add(chunk);
    }
    if (!assembled.ok()) {
      context.TryCancel();
      return assembled;
    }
    RETURN_IF_ERROR(rpc::FromGrpc(reader->Finish()));
    ASSIGN_OR_RETURN(content, assembler.Finish());
    return absl::OkStatus();
  };
  const absl::Status got = Insist(stop, std::numeric_limits<int>::max(), fetch);
  if (!got.ok()) return got;
  return content;
}

absl::Status ServerLink::PutBlob(const std::string& content, std::stop_token stop) {
  return Insist(stop, kMostRefusals, [&](grpc::ClientContext& context) -> absl::Status {
    ASSIGN_OR_RETURN(const auto stub, impl_->OpenStub());
    v1::BlobReceipt receipt;
    const auto writer = stub->PutBlob(&context, &receipt);
    for (const v1::BlobChunk& chunk : rpc::ToChunks(content)) {
      if (!writer->Write(chunk)) break;  // Finish() says why
    }
    writer->WritesDone();
    return rpc::FromGrpc(writer->Finish());
  });
}

}  // namespace calib::worker
