#include "proto/rpc/address.h"

#include <gtest/gtest.h>

namespace calib::rpc {
namespace {

TEST(Address, HostAndPort) {
  for (const char* good : {"localhost:7443", "127.0.0.1:1", "node-1.example.org:65535",
                           "[::1]:7443", "[fe80::1]:80"}) {
    EXPECT_EQ(ProblemOfAddress(good), "");
  }
  for (const char* bad :
       {"", "foo", "127.0.0.1", ":7443", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:-1",
        "127.0.0.1:99999", "127.0.0.1:7443/x", "http://127.0.0.1:7443", "http://node", "::1:7443",
        "[]:7443", "[::1]", "[::1]x:7443", "user@node:7443", "a b:7443", "127.0.0.1:7 "}) {
    EXPECT_EQ(ProblemOfAddress(bad),
              "'" + std::string(bad) + "' is not HOST:PORT with a port from 1 to 65535");
  }
}

TEST(Address, OrTheSocketOfAPath) {
  EXPECT_EQ(ProblemOfAddress("unix:/srv/calib/run/calib.sock"), "");
  EXPECT_EQ(SocketPathOf("unix:/a/b"), "/a/b");
  EXPECT_EQ(SocketPathOf("localhost:1"), "");
  for (const std::string& bad : {std::string("unix:"), std::string("unix:run/sock"),
                                 "unix:/" + std::string(kLongestSocketPath, 'a')}) {
    EXPECT_EQ(ProblemOfAddress(bad),
              "'" + bad + "' is not unix:/PATH with a path of at most 107 bytes");
  }
}

TEST(Address, AServerMayTakeAnyPort) {
  EXPECT_EQ(ProblemOfAddress("127.0.0.1:0", 0), "");
  EXPECT_EQ(ProblemOfAddress("127.0.0.1:65536", 0),
            "'127.0.0.1:65536' is not HOST:PORT with a port from 0 to 65535");
}

TEST(Address, OnlyThisMachineIsReachedByALoopback) {
  for (const char* own :
       {"127.0.0.1:1", "127.3.2.1:1", "localhost:7443", "[::1]:7443", "unix:/a/b"}) {
    EXPECT_TRUE(IsLoopback(own)) << own;
  }
  for (const char* open : {"0.0.0.0:1", "[::]:1", "node12:7443", "10.0.0.127:1",
                           "127.0.0.1.example.org:1", "127.example.org:1"}) {
    EXPECT_FALSE(IsLoopback(open)) << open;
  }
}

}  // namespace
}  // namespace calib::rpc
