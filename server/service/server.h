#pragma once
// The whole service in one object: calibd runs one, calibctl embeds one. No gRPC header is needed
// to use it.

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/service/limits.h"
#include "server/service/upkeep/log.h"
#include "server/store/store.h"

namespace grpc {
class Channel;
}

namespace calib::service {

struct ServerOptions {
  std::string state_dir{};  ///< created if need be; holds calib.db, lock, token and server.json
  /// HOST:PORT, port 0: a free one, see Server::port(); or unix:/PATH. Empty: a socket that only
  /// this account reaches (StateFolder::SocketAddress).
  std::string listen = "127.0.0.1:0";
  /// Folder of the server's certificate (`calibctl certs issue`); callers then show one too. Empty:
  /// plain text, and over TCP the token of the state folder.
  std::string tls{};
  bool insecure = false;  ///< plain text may be spoken with other machines
  /// The owner of this server starts it again when it ends, so that nobody else should serve the
  /// folder in between.
  bool stays = false;
  std::chrono::milliseconds lease{
      15'000};  ///< a worker is lost when nothing was heard from it for this long
  std::chrono::milliseconds heartbeat{2'000};  ///< workers speak at least this often
  Limits limits{};
  std::string log_file{};  ///< appended to; empty: standard error
  LogForm log{};
  /// Called once, on another thread, when the state can no longer be written (I/O error; a full
  /// disk is waited for): the server has stopped taking work and is to be shut down.
  std::function<void(const absl::Status&)> on_failure{};
  store::StoreHooks store_hooks{};  ///< for tests
};

/// Not thread-safe; it runs threads of its own.
class Server {
 public:
  /// Serves when it returns; unfinished campaigns go on. Errors: ALREADY_EXISTS when another
  /// process serves the folder (ServingAddress() in state_folder.h tells where); UNAVAILABLE when
  /// the address cannot be bound; INVALID_ARGUMENT for plain text that other machines reach without
  /// `insecure`, or a folder of a certificate that is not in order; those of store::Store::Open.
  static absl::StatusOr<std::unique_ptr<Server>> Start(ServerOptions options);
  /// Shutdown() if that has not been done.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  int port() const;  ///< 0: a socket of a path
  /// HOST:PORT or unix:/PATH for clients on this machine.
  std::string address() const;
  /// For questions of this very process, which need neither certificate nor token; what changes
  /// something is refused there. Usable until Shutdown().
  std::shared_ptr<grpc::Channel> InProcessChannel();
  /// Ends streams with UNAVAILABLE, waits for calls in progress at most this long, closes the
  /// store. Campaigns stay as they are and go on with the next Start().
  void Shutdown(std::chrono::milliseconds deadline);

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::service
