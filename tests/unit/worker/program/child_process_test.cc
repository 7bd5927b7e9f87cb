#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <thread>

#include "tests/unit/worker/program/program_of_test.h"
#include "worker/program/launcher.h"

namespace calib::worker {
namespace {

using ::calib::worker::testing::EndsSoon;
using ::calib::worker::testing::TemporaryFolder;
using std::chrono::milliseconds;

ChildOptions ShellOptions(const std::string& script, const std::string& folder = "/tmp") {
  return {.program = "/bin/sh",
          .arguments = {"sh", "-c", script},
          .folder = folder,
          .environment = {},
          .most_file_bytes = {}};
}

/// All that it prints until its end.
std::string OutputOf(ChildProcess& child) {
  std::string output;
  while (!child.end().has_value()) {
    child.Turn(milliseconds(50), [&](std::string_view bytes) { output += bytes; });
  }
  return output;
}

TEST(ChildProcess, RunsWithItsInputOutputAndWords) {
  const TemporaryFolder folder;
  Launcher launcher;
  auto child =
      launcher.Start(ShellOptions("pwd; cat; printf 'one\\ntwo' >&2; exit 7", folder.path()));
  ASSERT_TRUE(child.ok()) << child.status();
  (*child)->Send("asked\n");
  (*child)->CloseInput();
  EXPECT_EQ(OutputOf(**child), folder.path() + "\nasked\n");
  EXPECT_EQ((*child)->words(), "one\ntwo");
  EXPECT_EQ((*child)->end()->exit, 7);
}

TEST(ChildProcess, AnEnvironmentOfItsOwn) {
  Launcher launcher;
  setenv("CALIB_TEST_SECRET", "x", 1);
  setenv("CALIB_TEST_OTHER", "x", 1);
  ChildOptions options = ShellOptions("echo $A-$CALIB_TEST_SECRET-$CALIB_TEST_OTHER");
  options.environment = {"A=b", "CALIB_TEST_SECRET"};
  EXPECT_EQ(OutputOf(**launcher.Start(options)), "b--x\n");
}

TEST(ChildProcess, HasItsOwnGroupNoCoreFilesAndNoOtherFile) {
  Launcher launcher;
  signal(SIGUSR1, SIG_IGN);
  const int leaked = dup(STDERR_FILENO);  // without CLOEXEC
  auto child = launcher.Start(ShellOptions(
      "ulimit -c; ls /proc/self/fd | wc -l; ps -o pgid= -p $$ >/dev/null 2>&1; echo $$; "
      "cut -d' ' -f5 /proc/$$/stat; (kill -USR1 $BASHPID; kill -USR1 $$); echo alive"));
  ASSERT_TRUE(child.ok()) << child.status();
  const std::string output = OutputOf(**child);
  close(leaked);
  signal(SIGUSR1, SIG_DFL);
  std::istringstream lines(output);
  std::string core, files, pid, group, alive;
  lines >> core >> files >> pid >> group >> alive;
  EXPECT_EQ(core, "0");
  EXPECT_EQ(files, "4") << "the three and the folder that ls reads";
  EXPECT_EQ(pid, group);
  EXPECT_EQ(alive, "") << "what the worker ignores, a program does not";
  EXPECT_EQ((*child)->end()->signal, SIGUSR1);
}

TEST(ChildProcess, WhatCannotBeRunIsTold) {
  const TemporaryFolder folder;
  Launcher launcher;
  const auto told = [&](const std::string& program) {
    ChildOptions options = ShellOptions("");
    options.program = program;
    options.arguments = {"model"};
    const auto child = launcher.Start(options);
    EXPECT_EQ(child.status().code(), absl::StatusCode::kFailedPrecondition);
    return std::string(child.status().message());
  };
  const auto write = [&](const char* name, const char* content) {
    const std::string path = folder.path() + "/" + name;
    std::ofstream(path) << content;
    chmod(path.c_str(), 0700);
    return path;
  };
  EXPECT_EQ(told("/no/such"), "model: not found on this node");
  EXPECT_EQ(told("/tmp"), "model: may not be executed");
  EXPECT_EQ(told(write("a", "#!/no/such\n")),
            "model: the interpreter of its first line is not on this node");
  EXPECT_EQ(told(write("b", "hello\n")),
            "model: neither a program of this machine nor a script that begins with #!");
  ChildOptions nowhere = ShellOptions("");
  nowhere.folder = "/no/such";
  EXPECT_EQ(launcher.Start(nowhere).status().code(), absl::StatusCode::kUnavailable);
}

TEST(ChildProcess, WordsAreTheLastAndValid) {
  Launcher launcher;
  auto child =
      launcher.Start(ShellOptions("yes é | head -c 999999 >&2; printf '\\033[1mlast\\377\\n' >&2"));
  OutputOf(**child);
  const std::string words = (*child)->words();
  EXPECT_LE(words.size(), ChildProcess::kMostWords);
  EXPECT_GT(words.size(), ChildProcess::kMostWords - 10);
  EXPECT_TRUE(words.ends_with("é\n?[1mlast?\n")) << words.substr(words.size() - 20);
}

TEST(ChildProcess, InputThatNobodyReadsBlocksNothing) {
  Launcher launcher;
  auto child =
      launcher.Start(ShellOptions("echo first; sleep 0.2; exec <&-; echo second; sleep 0.1"));
  (*child)->Send(std::string(10'000'000, 'x'));
  EXPECT_EQ(OutputOf(**child), "first\nsecond\n");
  EXPECT_EQ((*child)->end()->exit, 0);
}

TEST(ChildProcess, EndsPolitelyOrNot) {
  Launcher launcher;
  const auto nothing = [](std::string_view) {};
  auto polite =
      launcher.Start(ShellOptions("trap 'exit 5' TERM; echo; while :; do sleep 0.01; done"));
  auto deaf = launcher.Start(ShellOptions("trap '' TERM; echo; while :; do sleep 0.01; done"));
  for (auto* child : {&polite, &deaf}) {
    bool ready = false;
    while (!ready) (**child)->Turn(milliseconds(50), [&](std::string_view) { ready = true; });
    (**child)->End(milliseconds(1000), nothing);
  }
  EXPECT_EQ((*polite)->end()->exit, 5);
  EXPECT_EQ((*deaf)->end()->signal, SIGKILL);
}

TEST(ChildProcess, DescendantsGoWithIt) {
  Launcher launcher;
  // One in the group whose parent has gone, one that has left the group as ranks of MPI do.
  const char* script =
      "(sleep 100 & echo $!); setsid sh -c 'echo $$; exec sleep 100' & sleep 0.3; echo; wait";
  for (const bool polite : {false, true}) {
    auto child = launcher.Start(ShellOptions(script));
    std::string output;
    while (output.find("\n\n") == std::string::npos) {
      (*child)->Turn(milliseconds(50), [&](std::string_view bytes) { output += bytes; });
    }
    std::istringstream lines(output);
    pid_t in_group = 0;
    pid_t outside = 0;
    lines >> in_group >> outside;
    ASSERT_GT(outside, 0);
    const TreeUse use = (*child)->Look();
    EXPECT_GE(use.members.size(), 2U);
    EXPECT_GT(use.resident_bytes, 1e5);
    if (polite) (*child)->End(milliseconds(200), [](std::string_view) {});
    child = absl::UnknownError("gone");
    EXPECT_TRUE(EndsSoon(in_group));
    EXPECT_TRUE(EndsSoon(outside));
  }
}

// PR_SET_PDEATHSIG fires when the thread ends that forked, not the process.
TEST(ChildProcess, OutlivesTheThreadThatStartedIt) {
  Launcher launcher;
  absl::StatusOr<std::unique_ptr<ChildProcess>> child = absl::UnknownError("not yet");
  std::thread([&] { child = launcher.Start(ShellOptions("sleep 0.3; echo here")); }).join();
  EXPECT_EQ(OutputOf(**child), "here\n");
}

TEST(ChildProcess, AFileMayNotGrowAboveItsLimit) {
  const TemporaryFolder folder;
  Launcher launcher;
  ChildOptions options = ShellOptions("head -c 100000 /dev/zero > big; echo $?", folder.path());
  options.most_file_bytes = 5000;
  EXPECT_NE(OutputOf(**launcher.Start(options)), "0\n");
}

TEST(ChildProcess, CountsItsTime) {
  Launcher launcher;
  auto child =
      launcher.Start(ShellOptions("i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done; sleep 0.3"));
  OutputOf(**child);
  EXPECT_GT((*child)->cpu_seconds(), 0.01);
  EXPECT_LT((*child)->cpu_seconds(), 5);
}

}  // namespace
}  // namespace calib::worker
