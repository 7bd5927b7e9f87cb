#pragma once
// The worker's end of the link: one bidirectional stream at a time over one channel. No gRPC header
// is needed to use it.

#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"
#include "proto/rpc/access.h"

namespace calib::worker {

/// Called on gRPC's threads; must only hand the news on.
struct LinkEvents {
  std::function<void(v1::ServerMessage)> received;
  std::function<void(const absl::Status&)>
      closed;  ///< last event of one Open(); OK: the server ended the stream
};

/// The connection to one server. Thread-safe.
class ServerLink {
 public:
  /// access: what is shown there (FindAccess), looked up anew for every connection.
  ServerLink(std::string address, rpc::AccessChoice access, LinkEvents events);
  /// Cancels an open stream and waits for its end.
  ~ServerLink();
  ServerLink(const ServerLink&) = delete;
  ServerLink& operator=(const ServerLink&) = delete;

  /// Starts a stream with this first message. The one before must have closed. After one that was
  /// not let in, over a new connection: a certificate may have been renewed. INVALID_ARGUMENT: what
  /// is to be shown cannot be found.
  absl::Status Open(const v1::Hello& hello);
  /// Queues a message behind those before it; it is dropped when no stream is open.
  void Send(v1::WorkerMessage message);
  /// No more messages follow; the server then ends the stream.
  void FinishSending();

  /// Whether there is something to show, by now, that the last connection did not: a token that a
  /// server has left since, a certificate that was renewed.
  bool HasMoreToShow();

  /// Content by digest: waits, with retries while the server is away, until it is there or `stop`.
  absl::StatusOr<std::string> GetBlob(const std::string& digest, std::stop_token stop);
  /// Stores content; waits as GetBlob. Errors: why the server does not take it.
  absl::Status PutBlob(const std::string& content, std::stop_token stop);

 private:
  class Stream;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::worker
