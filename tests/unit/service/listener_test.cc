#include "server/service/listener.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <vector>

#include "tests/support/process.h"

namespace calib::service {
namespace {

constexpr std::chrono::seconds kSoonAccepted{10};

int ConnectTo(int port) {
  const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(file, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  return file;
}

/// Whether the other side closes the connection soon.
bool IsTurnedAway(int file) {
  pollfd waiting{.fd = file, .events = POLLIN, .revents = 0};
  char byte = 0;
  return poll(&waiting, 1, 10'000) == 1 && recv(file, &byte, 1, 0) <= 0;
}

/// What was accepted, to be closed when the test says so.
class Accepting {
 public:
  void Take(int connection) {
    const std::lock_guard lock(mutex_);
    open_.push_back(connection);
  }
  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return open_.size();
  }
  void CloseAll() {
    const std::lock_guard lock(mutex_);
    for (const int connection : open_) close(connection);
    open_.clear();
  }

 private:
  mutable std::mutex mutex_;
  std::vector<int> open_;
};

TEST(Listener, TurnsAwayWhatIsBeyondItsNumberAndTakesMoreOnceSomeHaveEnded) {
  Accepting accepting;
  auto listener = Listener::Open("127.0.0.1:0", 2);
  ASSERT_TRUE(listener.ok()) << listener.status();
  (*listener)->Start([&](int connection) { accepting.Take(connection); });
  const int port = (*listener)->port();
  const int first = ConnectTo(port);
  const int second = ConnectTo(port);
  ASSERT_TRUE(testing::Eventually(kSoonAccepted, [&] { return accepting.size() == 2; }));
  const int third = ConnectTo(port);
  EXPECT_TRUE(IsTurnedAway(third));
  accepting.CloseAll();
  const int fourth = ConnectTo(port);
  EXPECT_TRUE(testing::Eventually(kSoonAccepted, [&] { return accepting.size() == 1; }));
  for (const int file : {first, second, third, fourth}) close(file);
  listener->reset();
  accepting.CloseAll();
}

// gRPC's listener never accepts again after this.
TEST(Listener, GoesOnAfterNoFileCouldBeOpened) {
  Accepting accepting;
  auto listener = Listener::Open("localhost:0", 1000);
  ASSERT_TRUE(listener.ok()) << listener.status();
  (*listener)->Start([&](int connection) { accepting.Take(connection); });
  std::vector<int> clients;
  for (int k = 0; k < 4; ++k) clients.push_back(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>((*listener)->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::vector<int> hoarded;
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  const rlimit few{.rlim_cur = std::min<rlim_t>(before.rlim_cur, 200), .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  for (int file = 0; (file = open("/dev/null", O_RDONLY | O_CLOEXEC)) >= 0;) {
    hoarded.push_back(file);
  }
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(connect(clients[k], reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_TRUE(IsTurnedAway(clients[k])) << "it is told so instead of waiting for ever";
  }
  EXPECT_EQ(accepting.size(), 0U);
  for (const int file : hoarded) close(file);
  setrlimit(RLIMIT_NOFILE, &before);
  ASSERT_EQ(connect(clients[3], reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_TRUE(testing::Eventually(kSoonAccepted, [&] { return accepting.size() == 1; }));
  for (const int file : clients) close(file);
  listener->reset();
  accepting.CloseAll();
}

TEST(Listener, SaysWhereItCannotListen) {
  auto first = Listener::Open("127.0.0.1:0", 1);
  ASSERT_TRUE(first.ok());
  const auto second = Listener::Open("127.0.0.1:" + std::to_string((*first)->port()), 1);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(second.status().message().find("in use"), std::string::npos);
  EXPECT_FALSE(Listener::Open("192.0.2.1:0", 1).ok()) << "no address of this machine";
}

TEST(RaiseFileLimit, ToTheHardOne) {
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  const rlimit lower{.rlim_cur = std::min<rlim_t>(before.rlim_max, 256),
                     .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &lower), 0);
  EXPECT_EQ(RaiseFileLimit(),
            static_cast<std::int64_t>(std::min<rlim_t>(before.rlim_max, 1 << 30)));
  rlimit now{};
  getrlimit(RLIMIT_NOFILE, &now);
  EXPECT_EQ(now.rlim_cur, before.rlim_max);
  setrlimit(RLIMIT_NOFILE, &before);
}

}  // namespace
}  // namespace calib::service
