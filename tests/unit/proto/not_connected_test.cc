#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <thread>

#include "proto/rpc/client_options.h"

namespace calib::rpc {
namespace {

using ::testing::HasSubstr;

/// A socket that takes one connection and then says `word`, or closes where there is none.
class Socket {
 public:
  explicit Socket(std::string word)
      : path_(std::filesystem::path(::testing::TempDir()) / ("s" + std::to_string(getpid()))),
        listener_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path_.c_str(), sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(listen(listener_, 1), 0);
    peer_ = std::thread([this, word = std::move(word)] {
      const int connection = accept(listener_, nullptr, nullptr);
      if (!word.empty()) {
        EXPECT_EQ(send(connection, word.data(), word.size(), 0), static_cast<ssize_t>(word.size()));
      }
      close(connection);
    });
  }
  ~Socket() {
    peer_.join();
    close(listener_);
    std::filesystem::remove(path_);
  }
  std::string Address() const { return "unix:" + path_.string(); }

 private:
  const std::filesystem::path path_;
  const int listener_;
  std::thread peer_;
};

TEST(WhyNotConnected, ToASocketThatSpeaksItIsByNow) {
  const Socket late("\x04");
  EXPECT_TRUE(WhyNotConnected(late.Address(), {}).ok());
}

TEST(WhyNotConnected, ToASocketThatClosesSaysSo) {
  const Socket full("");
  const absl::Status why = WhyNotConnected(full.Address(), {});
  EXPECT_EQ(why.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(why.message(), HasSubstr("closes it: it has no room"));
}

TEST(WhyNotConnected, WhereNothingIsSaysSo) {
  EXPECT_EQ(WhyNotConnected("unix:/nowhere/calib.sock", {}).code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace calib::rpc
