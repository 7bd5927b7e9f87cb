// A server that kills itself with -9 around its N-th commit: calibd_dying DIR LISTEN before|after N
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <string>

#include "server/service/server.h"

int main(int argc, char** argv) {
  if (argc != 5) {
    return 2;
  }
  const bool before = std::string(argv[3]) == "before";
  int left = std::atoi(argv[4]);
  const auto count = [&left] {
    if (--left == 0) {
      kill(getpid(), SIGKILL);
    }
  };
  calib::service::ServerOptions options;
  options.state_dir = argv[1];
  options.listen = argv[2];
  options.lease = std::chrono::milliseconds(3000);
  options.heartbeat = std::chrono::milliseconds(100);
  if (before) {
    options.store_hooks.before_commit = [count]() mutable {
      count();
      return absl::OkStatus();
    };
  } else {
    options.store_hooks.after_commit = count;
  }
  const auto server = calib::service::Server::Start(options);
  if (!server.ok()) {
    std::cerr << server.status() << '\n';
    return 1;
  }
  pause();
  return 0;
}
