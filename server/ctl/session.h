#pragma once
// The server that a verb talks to: one that runs already, or one embedded in this process over a
// state folder, with local workers beside it.

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/ctl/arguments.h"
#include "server/ctl/child_process.h"
#include "server/ctl/client.h"

namespace calib::service {
class Server;
}

namespace calib::ctl {

class Session {
 public:
  /// For most verbs: --state if given (which must exist unless may_create), else --server. Local
  /// workers start if asked for.
  static absl::StatusOr<std::unique_ptr<Session>> Open(const Arguments& arguments,
                                                       bool may_create = false);
  /// Ends workers, then the embedded server. Where every campaign of the folder has ended, what
  /// its resting runs would have gone on from goes too.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  Client& client() { return *client_; }
  const std::string& address() const { return address_; }  ///< HOST:PORT of its server
  /// The folder is served by another process, to which this session is connected.
  bool is_guest() const { return server_ == nullptr; }

  /// Starts `count` single-slot workers; each logs to worker-N.log in the state folder.
  absl::Status StartWorkers(int count);
  /// FAILED_PRECONDITION, with the end of the log, when all local workers have ended.
  absl::Status CheckWorkers();

 private:
  Session();
  /// Serves the folder, or joins who does; whoever is starting or ending just now is tried again.
  absl::Status ServeOrJoin();
  bool AllEnded();
  std::string Checkpoints() const;  ///< of local workers

  std::string state_;
  std::string address_;
  std::unique_ptr<service::Server> server_;  // nullptr: somebody else's
  std::unique_ptr<Client> client_;
  std::vector<ChildProcess> workers_;
};

}  // namespace calib::ctl
