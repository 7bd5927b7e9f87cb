// Several calibctl processes over one state folder: who serves it may end before the others.
#include <gmock/gmock.h>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

class SharedFolder : public CalibctlFixture {
 protected:
  SharedFolder() {
    Write("first.yaml", SmallCampaign(8, 1));
    Write("second.yaml", SmallCampaign(20, 2));
  }

  /// second.yaml, run while first.yaml's run serves the folder and `end` of that run ($host).
  Answer RunAsGuest(const std::string& end) {
    Write("both.sh", R"sh(
"$1" run first.yaml --state s --workers 1 >first 2>&1 & host=$!
until test -e s/server.json; do sleep 0.02; done
"$@" & guest=$!
until "$1" list --state s | grep -q '^c2 '; do sleep 0.02; done
kill -0 $host && echo yes >joined
)sh" + end + R"sh(
wait $guest
)sh");
    return CallWith("sh both.sh", "run second.yaml --state s --json");
  }
};

TEST_F(SharedFolder, AGuestGoesOnWhenItsHostIsDone) {
  const Answer guest = RunAsGuest("wait $host");
  ASSERT_EQ(guest.code, 0) << guest.err << Read("first");
  EXPECT_EQ(Read("joined"), "yes\n") << "the host was done before its guest came";
  EXPECT_EQ(guest.json()["model_evaluations"], 40 + 8) << "of these eight twins";
  EXPECT_THAT(guest.err, ::testing::HasSubstr("this one serves it now"));
  EXPECT_THAT(Read("first"), ::testing::HasSubstr("campaign c1"));
}

TEST_F(SharedFolder, AGuestTakesOverFromAHostThatIsKilled) {
  const Answer alone = Call("run second.yaml --state alone --json");
  ASSERT_EQ(alone.code, 0) << alone.err;
  const Answer guest = RunAsGuest(
      "until \"$1\" list --state s | grep -q '^c2 '; do sleep 0.05; done; kill -9 $host");
  ASSERT_EQ(guest.code, 0) << guest.err << Read("first");
  EXPECT_EQ(guest.json()["parameters"], alone.json()["parameters"]);
  EXPECT_EQ(Call("run first.yaml --state s").code, 0) << Read("err");
}

TEST_F(SharedFolder, WhoWatchesServesOnceTheHostIsGone) {
  Write("watch.sh", R"sh(
"$1" run first.yaml --state s --workers 1 >first 2>&1 & host=$!
until test -e s/server.json; do sleep 0.02; done
"$1" submit second.yaml --state s >second
"$@" & guest=$!
wait $host
"$1" show c2 --state s >at_the_end
"$1" watch c2 --state s --workers 2 >/dev/null 2>&1
wait $guest
)sh");
  const Answer watched = CallWith("sh watch.sh", "watch c2 --state s");
  EXPECT_EQ(Read("second"), "c2\n");
  EXPECT_THAT(Read("at_the_end"), ::testing::Not(::testing::HasSubstr("finished")));
  EXPECT_EQ(watched.code, 0) << watched.err;
  EXPECT_THAT(watched.out, ::testing::HasSubstr("c2 is finished"));
}

}  // namespace
}  // namespace calib::ctl
