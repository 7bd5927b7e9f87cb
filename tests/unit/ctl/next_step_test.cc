#include "server/ctl/next_step.h"

#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

TEST(NextStep, NamesTheServerOfThisCall) {
  client::ServerChoice server;
  EXPECT_EQ(CommandOf(server, "show c1"), "calibctl show c1");
  server.address = "node:7443";
  EXPECT_EQ(CommandOf(server, "show c1"), "calibctl show c1") << "from the environment";
  server.given = true;
  EXPECT_EQ(CommandOf(server, "show c1"), "calibctl show c1 --server node:7443");
  server.state = "state";
  EXPECT_EQ(CommandOf(server, "show c1"), "calibctl show c1 --state state");
  server.state = "John's sand";
  EXPECT_EQ(CommandOf(server, "show c1"), "calibctl show c1 --state 'John'\\''s sand'");
}

}  // namespace
}  // namespace calib::ctl
