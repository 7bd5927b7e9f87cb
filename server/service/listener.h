#pragma once
// The listening socket. gRPC's own gives up for good when a connection comes and no file can be
// opened [grpc issue 20418]; here connections are counted, those beyond a number are closed, and
// whatever goes wrong passes.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::service {

/// Raises the limit of open files of this process to the hardest that the system allows; returns
/// what it is then.
std::int64_t RaiseFileLimit();

/// Accepts on one thread of its own. Not thread-safe but for that.
class Listener {
 public:
  /// Binds every address that HOST stands for and listens; port 0: a free one. Or the socket of
  /// unix:/PATH (mode 0600), in the place of one that a killed server has left; only programs of
  /// this account, or of root, are let in there. UNAVAILABLE: in use, no address of this machine,
  /// or no place for a socket, as where a file is that is none. most: connections that are open at
  /// a time.
  static absl::StatusOr<std::unique_ptr<Listener>> Open(const std::string& address, int most);
  /// Stops accepting and removes the socket's file, if it still is this one's; what was accepted
  /// stays open.
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int port() const { return port_; }  ///< 0: a socket of a path
  /// From now on every connection is given to `accepted`, which owns it, on the listener's thread.
  void Start(std::function<void(int connection)> accepted);

 private:
  struct Accepted {
    int connection = -1;
    std::uint64_t inode = 0;  // tells whether the number still stands for the same socket
  };
  Listener(std::vector<int> sockets, int port, std::string path, int most);
  static absl::StatusOr<std::unique_ptr<Listener>> OpenPath(const std::string& path, int most);
  void Loop();
  void AcceptFrom(int socket);
  bool HasRoom();
  static bool IsOfThisAccount(int connection);
  void SayOnce(const char* what, int error);

  const std::vector<int> sockets_;
  const int port_;
  const std::string path_;  // of a Unix socket; empty: TCP
  std::uint64_t path_inode_ = 0;
  const std::size_t most_;
  int stop_ = -1;   // an eventfd
  int spare_ = -1;  // given up to turn a connection away when no file can be opened
  std::function<void(int)> accepted_;
  std::vector<Accepted> open_;  // the thread's: those accepted, some of them closed since
  bool said_ = false;           // the thread's: that connections are turned away
  std::thread thread_;
};

}  // namespace calib::service
