#pragma once
// The server that a verb talks to: one that runs already, or one embedded in this process over a
// state folder, with local workers beside it.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "server/client/child_process.h"
#include "server/client/client.h"
#include "server/client/server_choice.h"

namespace calib::service {
class Server;
}

namespace calib::client {

/// Not thread-safe.
class Session {
 public:
  /// For most verbs: --state if given (which must exist unless may_create), else --server. Local
  /// workers start if asked for.
  static absl::StatusOr<std::unique_ptr<Session>> Open(const ServerChoice& choice,
                                                       bool may_create = false);
  /// Ends workers, then the embedded server. Where every campaign of the folder has ended, what
  /// its resting runs would have gone on from goes too.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  Client& client() { return *client_; }
  const std::string& address() const { return address_; }  ///< of the server
  Client::Place place() const { return {.address = address_, .access = AccessAt(address_)}; }
  bool shows_certificate() const;  ///< --tls or $CALIB_TLS, and no socket
  /// The folder is served by another process, to which this session is connected. When that ends,
  /// this one serves the folder, unless it was calibd, which is waited for.
  bool is_guest() const { return server_ == nullptr; }

  /// Starts `count` single-slot workers; each logs to worker-N.log in the state folder. Without a
  /// count: one per core when this process serves the folder, now or once it takes over.
  absl::Status UseWorkers(std::optional<int> count);
  int workers() const { return static_cast<int>(workers_.size()); }
  /// Why nothing will happen any more: RESOURCE_EXHAUSTED or the like, the served folder cannot be
  /// written; FAILED_PRECONDITION, with the end of the log, all local workers have ended.
  absl::Status Check();

 private:
  Session();
  /// Serves the folder, or joins who does.
  absl::Status ServeOrJoin();
  /// The address of who serves the folder, this process if nobody does. Whoever is starting or
  /// ending just now is tried again.
  absl::StatusOr<std::string> ServeOrFind();
  /// What is shown to the server at an address: of a folder that calibd serves, its token.
  rpc::AccessChoice AccessAt(const std::string& address) const;
  /// After the process that served the folder has ended: serves it, or finds who does; the address
  /// for the client, "" when it is hopeless (Check() says why). A server that stays is waited for.
  std::string TakeOverOrFind();
  std::string GiveUp(const absl::Status& why);
  absl::Status StartWorkers(int count);
  bool AllEnded();
  /// Folder of the checkpoints of local workers.
  std::string Checkpoints() const;

  /// What ended the service of the folder; may be set on another thread.
  struct Failure {
    absl::Mutex mutex;
    absl::Status status ABSL_GUARDED_BY(mutex);
    absl::Status Get() {
      absl::MutexLock lock(&mutex);
      return status;
    }
  };

  ServerChoice choice_;
  std::string state_;
  std::string address_;
  std::shared_ptr<Failure> failure_ = std::make_shared<Failure>();
  std::unique_ptr<service::Server> server_;  // nullptr: somebody else's
  std::unique_ptr<Client> client_;
  std::vector<ChildProcess> workers_;
  int workers_as_host_ = 0;
  bool host_stays_ = false;
};

}  // namespace calib::client
