#include "server/ctl/next_step.h"

#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

TEST(NextStep, NamesTheServerOfThisCall) {
  Arguments arguments;
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1");
  arguments.server = "node:7443";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1") << "from the environment";
  arguments.server_given = true;
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --server node:7443");
  arguments.state = "state";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --state state");
  arguments.state = "John's sand";
  EXPECT_EQ(CommandOf(arguments, "show c1"), "calibctl show c1 --state 'John'\\''s sand'");
}

}  // namespace
}  // namespace calib::ctl
