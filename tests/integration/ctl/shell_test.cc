// What shells and `man` are told of calibctl: completed by the shells themselves, set by man.
#include <gmock/gmock.h>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::testing::StartsWith;

class CalibctlShell : public CalibctlFixture {
 protected:
  // What a shell says, given a script; its standard error in `err`.
  std::vector<std::string> Say(const std::string& shell, const std::string& script) const {
    Write("script", script);
    const std::string command =
        "cd '" + work_.string() + "' && HOME=. " + shell + " script >said 2>err </dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0) << Read("err");
    EXPECT_EQ(Read("err"), "");
    std::vector<std::string> lines;
    std::istringstream said(Read("said"));
    for (std::string line; std::getline(said, line);) lines.push_back(line);
    return lines;
  }

  // What bash offers for the last of these words.
  std::vector<std::string> Bash(const std::string& words) const {
    return Say("bash", "source ./completion.bash; COMP_WORDS=(" + words +
                           "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _calibctl; "
                           "printf '%s\\n' \"${COMPREPLY[@]}\"");
  }
};

TEST_F(CalibctlShell, BashCompletesVerbsOptionsAndFiles) {
  const Answer script = Call("completion bash");
  ASSERT_EQ(script.code, 0) << script.err;
  Write("completion.bash", script.out);
  EXPECT_THAT(Bash("calibctl sim"), ::testing::ElementsAre("simulate"));
  EXPECT_THAT(Bash("calibctl --state dir --json po"), ::testing::ElementsAre("posterior"));
  EXPECT_THAT(Bash("calibctl ''"), IsSupersetOf({"run", "diagnose", "vtk", "man"}));
  EXPECT_THAT(Bash("calibctl vtk --l"), ::testing::ElementsAre("--load-step"));
  EXPECT_THAT(Bash("calibctl vtk c1 --"), AllOf(IsSupersetOf({"--load-step", "--state", "--json"}),
                                                Each(StartsWith("--")), Not(Contains("--seed"))));
  EXPECT_THAT(Bash("calibctl run --seed --"), ::testing::ElementsAre("")) << "a value";
  EXPECT_THAT(Bash("calibctl run sand"), ::testing::ElementsAre("")) << "a file, which bash knows";
}

TEST_F(CalibctlShell, FishCompletesVerbsAndOptions) {
  Write("completion.fish", Call("completion fish").out);
  const auto offered = [this](const std::string& line) {
    return Say("fish", "source ./completion.fish; complete -C '" + line + "'");
  };
  EXPECT_THAT(offered("calibctl sim"),
              ::testing::ElementsAre(StartsWith("simulate\tOne model evaluation")));
  EXPECT_THAT(offered("calibctl vtk c1 --load"),
              ::testing::ElementsAre(StartsWith("--load-step\tthe only one")));
  EXPECT_THAT(offered("calibctl run --load"), ::testing::IsEmpty());
}

TEST_F(CalibctlShell, ZshReadsItsScript) {
  Write("_calibctl", Call("completion zsh").out);
  const std::vector<std::string> said =
      Say("zsh -f",
          "autoload -Uz compinit && compinit -D -u; source ./_calibctl; "
          "print $_comps[calibctl]; functions _calibctl");
  ASSERT_FALSE(said.empty());
  EXPECT_EQ(said.front(), "_calibctl");
  EXPECT_THAT(said, Contains(::testing::HasSubstr("--load-step[the only one that is wanted")));
}

TEST_F(CalibctlShell, AnotherShellIsRefused) {
  const Answer answer = Call("completion tcsh");
  EXPECT_EQ(answer.code, 2);
  EXPECT_EQ(answer.err, "calibctl: SHELL: 'tcsh' is not bash, zsh or fish\n");
  EXPECT_EQ(answer.out, "");
}

TEST_F(CalibctlShell, ManSetsEveryPageWithoutAWarning) {
  const Answer answer = Call("man -o pages --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  std::size_t pages = 0;
  for (const auto& page : std::filesystem::directory_iterator(work_ / "pages")) {
    ++pages;
    const auto lines =
        Say("sh", "MANPAGER=cat MANWIDTH=80 man --warnings=w -l '" + page.path().string() + "'");
    EXPECT_GT(lines.size(), 15U) << page.path();
  }
  EXPECT_EQ(answer.json()["pages"], pages);
  const auto set =
      Say("sh", "MANPAGER=cat MANWIDTH=80 man -l pages/calibctl-vtk.1 | sed 's/.\\x08//g'");
  EXPECT_THAT(set, IsSupersetOf({"SYNOPSIS", "EXAMPLE",
                                 "       calibctl vtk c1 17 --load-step 12 -o pictures --state "
                                 "calib-state"}));
  EXPECT_THAT(set, Contains(StartsWith("       -o, --output VALUE")));
  EXPECT_EQ(Call("man -o /proc/nowhere").code, 1);
}

TEST_F(CalibctlShell, VersionNamesBuildAndMechanics) {
  const Answer answer = Call("--version");
  EXPECT_EQ(answer.code, 0);
  EXPECT_THAT(answer.out,
              ::testing::MatchesRegex("calibctl [0-9.]+\nmechanics [^\n]+\ncatalogue [0-9a-f]+\n"));
}

}  // namespace
}  // namespace calib::ctl
