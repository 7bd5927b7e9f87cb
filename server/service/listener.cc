#include "server/service/listener.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/address.h"

namespace calib::service {
namespace {

/// Connections that wait to be accepted. The system has a bound of its own (net.core.somaxconn).
constexpr int kBacklog = 512;
/// After an error that will pass: the socket stays readable meanwhile.
constexpr std::chrono::milliseconds kPause{50};

/// Binds one address; -1: it cannot be. port: in place of the address's own unless 0; then the one
/// that was found.
int Bind(const addrinfo& address, int& port) {
  sockaddr_storage own{};
  std::memcpy(&own, address.ai_addr, address.ai_addrlen);
  auto* as_v4 = reinterpret_cast<sockaddr_in*>(&own);
  auto* as_v6 = reinterpret_cast<sockaddr_in6*>(&own);
  const bool is_v6 = address.ai_family == AF_INET6;
  in_port_t& own_port = is_v6 ? as_v6->sin6_port : as_v4->sin_port;
  if (port != 0) {
    own_port = htons(static_cast<std::uint16_t>(port));
  }
  const int socket_fd =
      socket(address.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, IPPROTO_TCP);
  if (socket_fd < 0) {
    return -1;
  }
  const int yes = 1;
  const int no = 0;
  setsockopt(socket_fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  setsockopt(socket_fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));  // what is accepted inherits
  if (is_v6) {
    setsockopt(socket_fd, IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof(no));
  }
  socklen_t length = sizeof(own);
  if (bind(socket_fd, reinterpret_cast<sockaddr*>(&own), address.ai_addrlen) != 0 ||
      listen(socket_fd, kBacklog) != 0 ||
      getsockname(socket_fd, reinterpret_cast<sockaddr*>(&own), &length) != 0) {
    close(socket_fd);
    return -1;
  }
  port = ntohs(own_port);
  return socket_fd;
}

/// 0: it is closed.
std::uint64_t InodeOf(int file) {
  struct stat status = {};
  return fstat(file, &status) == 0 && S_ISSOCK(status.st_mode) ? status.st_ino : 0;
}

int OpenSpare() { return open("/dev/null", O_RDONLY | O_CLOEXEC); }

}  // namespace

std::int64_t RaiseFileLimit() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const rlimit raised{.rlim_cur = limit.rlim_max, .rlim_max = limit.rlim_max};
  if (setrlimit(RLIMIT_NOFILE, &raised) == 0) {
    limit = raised;
  }
  constexpr rlim_t kEnough = 1 << 30;  // or no limit at all
  return static_cast<std::int64_t>(std::min(limit.rlim_cur, kEnough));
}

absl::StatusOr<std::unique_ptr<Listener>> Listener::Open(const std::string& host_port, int most) {
  if (const std::string path = rpc::SocketPathOf(host_port); !path.empty()) {
    return OpenPath(path, most);
  }
  const std::string host = rpc::HostOf(host_port);
  const std::string bare =
      host.starts_with("[") && host.ends_with("]") ? host.substr(1, host.size() - 2) : host;
  const std::string service = host_port.substr(host_port.rfind(':') + 1);
  const addrinfo wanted{.ai_flags = AI_PASSIVE | AI_NUMERICSERV,
                        .ai_family = AF_UNSPEC,
                        .ai_socktype = SOCK_STREAM,
                        .ai_protocol = 0,
                        .ai_addrlen = 0,
                        .ai_addr = nullptr,
                        .ai_canonname = nullptr,
                        .ai_next = nullptr};
  addrinfo* found = nullptr;
  std::vector<int> sockets;
  int port = 0;
  if (getaddrinfo(bare.c_str(), service.c_str(), &wanted, &found) == 0) {
    for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
      if (const int socket_fd = Bind(*address, port); socket_fd >= 0) {
        sockets.push_back(socket_fd);
      }
    }
    freeaddrinfo(found);
  }
  if (sockets.empty()) {
    return absl::UnavailableError(absl::StrCat("cannot listen on ", host_port,
                                               ": in use, or not an address of this machine"));
  }
  return std::unique_ptr<Listener>(new Listener(std::move(sockets), port, "", most));
}

absl::StatusOr<std::unique_ptr<Listener>> Listener::OpenPath(const std::string& path, int most) {
  const auto cannot = [&path](const char* what) {
    return absl::UnavailableError(absl::StrCat("cannot listen on unix:", path, ": ", what, ": ",
                                               std::generic_category().message(errno)));
  };
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    errno = ENAMETOOLONG;
    return cannot("path");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  if (struct stat there = {}; lstat(path.c_str(), &there) == 0) {
    if (!S_ISSOCK(there.st_mode)) {
      errno = EEXIST;
      return cannot("a file that is no socket");
    }
    const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool is_served =
        connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    close(probe);
    if (is_served) {
      errno = EADDRINUSE;
      return cannot("another server");
    }
    unlink(path.c_str());  // left by a server that was killed
  }
  const int socket_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_fd < 0) {
    return cannot("socket");
  }
  constexpr mode_t kOwnerOnly = S_IRUSR | S_IWUSR;
  if (fchmod(socket_fd, kOwnerOnly) != 0 ||
      bind(socket_fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0 ||
      chmod(path.c_str(), kOwnerOnly) != 0 || listen(socket_fd, kBacklog) != 0) {
    const int error = errno;
    close(socket_fd);
    errno = error;
    return cannot("bind");
  }
  std::unique_ptr<Listener> listener(new Listener({socket_fd}, 0, path, most));
  if (struct stat bound = {}; lstat(path.c_str(), &bound) == 0) {
    listener->path_inode_ = bound.st_ino;
  }
  return listener;
}

Listener::Listener(std::vector<int> sockets, int port, std::string path, int most)
    : sockets_(std::move(sockets)),
      port_(port),
      path_(std::move(path)),
      most_(static_cast<std::size_t>(most)),
      stop_(eventfd(0, EFD_CLOEXEC)),
      spare_(OpenSpare()) {}

Listener::~Listener() {
  if (thread_.joinable()) {
    eventfd_write(stop_, 1);
    thread_.join();
  }
  for (const int socket_fd : sockets_) {
    close(socket_fd);
  }
  if (struct stat there = {};
      !path_.empty() && lstat(path_.c_str(), &there) == 0 && there.st_ino == path_inode_) {
    unlink(path_.c_str());
  }
  close(stop_);
  if (spare_ >= 0) {
    close(spare_);
  }
}

void Listener::Start(std::function<void(int)> accepted) {
  accepted_ = std::move(accepted);
  thread_ = std::thread([this] { Loop(); });
}

void Listener::Loop() {
  std::vector<pollfd> waiting;
  for (const int socket_fd : sockets_) {
    waiting.push_back({.fd = socket_fd, .events = POLLIN, .revents = 0});
  }
  waiting.push_back({.fd = stop_, .events = POLLIN, .revents = 0});
  while (true) {
    if (poll(waiting.data(), waiting.size(), -1) < 0) {
      if (errno != EINTR) std::this_thread::sleep_for(kPause);
      continue;
    }
    if (waiting.back().revents != 0) {
      return;
    }
    for (const pollfd& of_socket : waiting) {
      if (of_socket.revents != 0) AcceptFrom(of_socket.fd);
    }
  }
}

void Listener::AcceptFrom(int socket) {
  const int connection = accept4(socket, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (connection >= 0) {
    if (!path_.empty() && !IsOfThisAccount(connection)) {
      close(connection);
      SayOnce("it comes from another account", 0);
      return;
    }
    if (!HasRoom()) {
      close(connection);
      SayOnce("as many are open as the server takes (calibd --max-connections)", 0);
      return;
    }
    said_ = false;
    open_.push_back({.connection = connection, .inode = InodeOf(connection)});
    accepted_(connection);
    return;
  }
  const int error = errno;
  if (error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM) {
    // The one that waits is told at once that there is no room, instead of waiting for ever.
    if (spare_ >= 0) {
      close(std::exchange(spare_, -1));
      if (const int turned_away = accept4(socket, nullptr, nullptr, SOCK_CLOEXEC);
          turned_away >= 0) {
        close(turned_away);
      }
    }
    spare_ = OpenSpare();
    SayOnce("no file can be opened", error);
    std::this_thread::sleep_for(kPause);
  }
  // Anything else is the end of the connection that came.
}

bool Listener::IsOfThisAccount(int connection) {
  ucred peer{};
  socklen_t length = sizeof(peer);
  return getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &length) == 0 &&
         (peer.uid == geteuid() || peer.uid == 0);
}

bool Listener::HasRoom() {
  if (open_.size() < most_) {
    return true;
  }
  std::erase_if(open_, [](const Accepted& accepted) {
    return InodeOf(accepted.connection) != accepted.inode;
  });
  return open_.size() < most_;
}

void Listener::SayOnce(const char* what, int error) {
  if (!std::exchange(said_, true)) {
    spdlog::warn("connection_turned_away reason=\"{}{}\"", what,
                 error == 0 ? "" : ": " + std::generic_category().message(error));
  }
}

}  // namespace calib::service
