#pragma once
// HTTP/1.1 over Boost.Beast, on one thread of its own that never waits for anybody: GET and HEAD,
// within limits of size, time and number, so that no peer is in the way of another.

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/page/http_message.h"

namespace calib::page {

/// Chosen: many times what some browsers need, and little for the machine.
struct HttpLimits {
  std::size_t connections = 256;       ///< beyond it the one that has been idle longest goes
  std::size_t feeds = 64;              ///< answers without an end, of all peers
  std::size_t header_bytes = 8192;     ///< of a request
  std::chrono::seconds request{10};    ///< from the connection, or the answer before, to a request
                                       ///< that is whole; 6 times that between two requests
  std::chrono::seconds write{30};      ///< for a piece of a feed, and for 1 MiB of an answer
  std::chrono::seconds heartbeat{10};  ///< between two pieces of a feed, which is a comment then
};

struct HttpOptions {
  std::string listen{};  ///< HOST:PORT, port 0: a free one
  std::string tls{};     ///< folder of the server's certificate; empty: plain text
  HttpLimits limits{};
};

/// Post() may be called on any thread.
class HttpServer {
 public:
  /// Calls `finish` once, on the server's thread, now or later.
  using Finish = std::function<void(HttpAnswer)>;
  /// Called on the server's thread. Methods are GET and HEAD; others have been answered.
  using Handler = std::function<void(const HttpRequest&, Finish)>;

  /// Listens. UNAVAILABLE, a sentence: the address is taken, or none of this machine.
  /// INVALID_ARGUMENT: a folder of a certificate that is not in order. refuse: the answer to a
  /// request that is none, by its status and a sentence.
  static absl::StatusOr<std::unique_ptr<HttpServer>> Open(
      const HttpOptions& options, Handler handler,
      std::function<HttpAnswer(int status, const std::string& why)> refuse);
  ~HttpServer();  ///< Stop()
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const;
  /// Takes connections from now on. Once.
  void Begin();
  /// Runs on the server's thread, in order; after Stop() never.
  void Post(std::function<void()> task);
  /// Closes all connections and ends the thread.
  void Stop();

  struct Impl;

 private:
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::page
