#include "server/ctl/next_step.h"

#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

TEST(NextStep, NamesTheServerOfThisCall) {
  Arguments arguments;
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1");
  arguments.server.address = "node:7443";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1") << "from the environment";
  arguments.server.given = true;
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --server node:7443");
  arguments.server.state = "state";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --state state");
  arguments.server.state = "John's sand";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --state 'John'\\''s sand'");
}

}  // namespace
}  // namespace calib::ctl
