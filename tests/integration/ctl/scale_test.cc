// Workers on a cluster as an operator asks for them, here without one: deploy/slurm/test has one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

class Scale : public CalibctlFixture {};

TEST_F(Scale, DryRunPrintsTheScriptAndNeedsNeitherServerNorSlurm) {
  const Answer answer = CallWith(
      "env PATH=/nowhere", "scale --slurm 4 --time 30 --dry-run --server head:1 --token 'a b'");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("\n#SBATCH --array=1-4\n"));
  EXPECT_THAT(answer.out, HasSubstr("\n#SBATCH --time=30\n"));
  EXPECT_THAT(answer.out, HasSubstr("/a b'"));
  Write("script", answer.out);
  EXPECT_EQ(std::system(("sh -n '" + (work_ / "script").string() + "'").c_str()), 0) << answer.out;
}

TEST_F(Scale, WhatCannotBeIsSaidBeforeAnythingIsAsked) {
  for (const auto& [arguments, says] : std::vector<std::pair<std::string, std::string>>{
           {"scale", "--slurm is required"},
           {"scale --slurm 3 --time 1h", "--time \"1h\" is no time of Slurm"},
           {"scale --slurm 3 --partition 'a b'", "--partition \"a b\" is no name"},
           {"scale --slurm 3 --state s", "need a calibd"},
           {"scale --slurm 3 --server unix:/s", "no other node reaches unix:/s"},
           {"scale --slurm 3 --tls t", "--worker-tls"},
           {"scale --slurm 0 --dry-run", "starts nothing"}}) {
    const Answer answer = Call(arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    EXPECT_THAT(answer.err, HasSubstr(says)) << arguments;
  }
  EXPECT_EQ(Call("scale --slurm 3 --server 127.0.0.1:1").code, 3) << "no server";
}

}  // namespace
}  // namespace calib::ctl
