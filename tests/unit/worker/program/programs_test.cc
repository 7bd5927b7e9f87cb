#include "worker/program/programs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "proto/rpc/digest.h"
#include "tests/unit/worker/program/program_of_test.h"

namespace calib::worker {
namespace {

using ::calib::worker::testing::Answers;
using ::calib::worker::testing::EndsSoon;
using ::calib::worker::testing::Outcome;
using ::calib::worker::testing::ProgramsTest;
using std::chrono::milliseconds;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::Not;
using ::testing::Pair;
using ::testing::StartsWith;

/// A stop after so long.
class StopLater {
 public:
  explicit StopLater(milliseconds wait)
      : thread_([this, wait] {
          std::this_thread::sleep_for(wait);
          source_.request_stop();
        }) {}
  std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread thread_;
};

TEST_F(ProgramsTest, ARunThatCompletes) {
  v1::ProgramRun run = Python(R"(
import json, os, sys
asked = json.loads(sys.stdin.read())
assert asked == json.load(open('request.json'))
print('a remark')
for k, x in enumerate(asked['control']['values']):
    print(json.dumps({'load_step': k, 'y': asked['parameters']['a'] * x, 'more': k}))
assert os.environ['PYTHONUNBUFFERED'] == '1' and os.environ['OMP_NUM_THREADS'] == '3'
assert os.getcwd() == os.environ['PWD'] and 'CALIB_TOKEN' not in os.environ
print('remark on error', file=sys.stderr)
)");
  setenv("CALIB_TOKEN", "secret", 1);
  (*run.mutable_parameters())["a"] = 0.1;
  run.set_threads(3);
  const Outcome outcome = Evaluate(run);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
      << outcome.finished.reason() << outcome.report.words;
  ASSERT_EQ(outcome.states.size(), 3U);
  EXPECT_EQ(outcome.states[2].values(0), 0.1 * (0.1 * 2));
  EXPECT_EQ(outcome.states[2].others().at("more"), 2);
  EXPECT_GT(outcome.finished.core_seconds(), 0.005);
  EXPECT_GT(outcome.report.peak_memory, 1e5);
  EXPECT_GT(outcome.report.wall_seconds, 0.005);
  EXPECT_EQ(outcome.report.ignored_lines, 1);
  EXPECT_THAT(outcome.report.ignored, ElementsAre("a remark"));
  EXPECT_EQ(outcome.report.words, "remark on error\n");
  EXPECT_EQ(nlohmann::json::parse(outcome.report.request).at("run"), "1");
  EXPECT_FALSE(outcome.report.all_at_once);
  EXPECT_THAT(outcome.finished.words(), IsEmpty());
}

TEST_F(ProgramsTest, EveryStateThereIsCompleteWhateverFollows) {
  for (const char* end : {"exit 1", "exit 3", "kill -SEGV $$", "printf '{\"load'; kill -KILL $$",
                          "sleep 100", "trap '' TERM; sleep 100 & wait; sleep 100"}) {
    const Outcome outcome = Evaluate(Shell(Answers(0, 3) + end));
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
        << end << ": " << outcome.finished.reason();
    EXPECT_EQ(outcome.states.size(), 3U);
    EXPECT_LT(outcome.seconds, 5);
  }
}

TEST_F(ProgramsTest, ALineBeyondTheLastStepFails) {
  const Outcome outcome = Evaluate(Shell(Answers(0, 4)));
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_EQ(outcome.finished.reason(), "load step 3 is beyond the last, 2");
  EXPECT_EQ(outcome.states.size(), 3U);
}

TEST_F(ProgramsTest, HowItDiverges) {
  Outcome outcome = Evaluate(Shell(Answers(0, 1) + "echo no; echo 'grains lost' >&2; exit 3"));
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED);
  EXPECT_EQ(outcome.finished.reason(), "grains lost");
  EXPECT_EQ(outcome.finished.words(), "grains lost\n");
  EXPECT_EQ(outcome.finished.states(), 1);
  outcome = Evaluate(Shell("exit 3"));
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED);
  EXPECT_EQ(outcome.finished.reason(), "exit 3 with 0 of 3 states");
  for (const char* value : {"NaN", "-Infinity", "null"}) {
    outcome = Evaluate(
        Shell(Answers(0, 1) + "echo '{\"load_step\": 1, \"y\": " + value + "}'; sleep 100"));
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED);
    EXPECT_THAT(outcome.finished.reason(), HasSubstr(" at load step 1"));
    EXPECT_LT(outcome.seconds, 5);
  }
}

TEST_F(ProgramsTest, HowItFails) {
  const auto reason = [this](const std::string& script) {
    const Outcome outcome = Evaluate(Shell(script));
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED) << script;
    EXPECT_LT(outcome.seconds, 5);
    return outcome.finished.reason();
  };
  EXPECT_EQ(reason(Answers(0, 2)), "exit 0 with 2 of 3 states");
  EXPECT_EQ(reason("exit 5"), "exit 5 with 0 of 3 states");
  EXPECT_EQ(reason("echo first >&2; echo 'no table' >&2; exit 1"),
            "exit 1 with 0 of 3 states: no table");
  EXPECT_EQ(reason(Answers(0, 1) + "kill -SEGV $$"), "ended by SIGSEGV with 1 of 3 states");
  EXPECT_THAT(reason("kill -KILL $$"), StartsWith("ended by SIGKILL (the machine"));
  EXPECT_EQ(
      reason("echo 'y = 1'; echo 'y = 2'"),
      "exit 0 with 0 of 3 states; 2 lines that do not begin with '{' were ignored, the first: "
      "y = 1");
  EXPECT_THAT(reason("echo '{oops'; sleep 100"), HasSubstr("no JSON object"));
  EXPECT_THAT(reason(Answers(1, 2) + "sleep 100"), HasSubstr("the first is 0"));
  const Outcome outcome = Evaluate(Shell("yes word | head -c 100000 >&2; exit 1"));
  EXPECT_EQ(outcome.finished.words().size(), 4096U);
}

TEST_F(ProgramsTest, StatesThatWerePrintedBeforeACrashCount) {
  const Outcome outcome =
      Evaluate(Shell("sleep 0.1\n" + Answers(0, 2) + "printf '{\"load_step\": 2, \"y'; exit 1"));
  EXPECT_EQ(outcome.finished.reason(), "exit 1 with 2 of 3 states");
  EXPECT_EQ(outcome.states.size(), 2U);
}

TEST_F(ProgramsTest, AGigabyteOfRemarksHoldsNothingUp) {
  const Outcome outcome = Evaluate(
      Shell("yes 'a remark that nobody reads' | head -c 1000000000\necho\n" + Answers(0, 3)));
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
      << outcome.finished.reason();
  EXPECT_GT(outcome.report.ignored_lines, 30'000'000);
  EXPECT_EQ(outcome.report.ignored.size(), 5U);
}

TEST_F(ProgramsTest, ARequestThatNobodyReadsHoldsNothingUp) {
  v1::ProgramRun run = Shell("true");
  run.clear_control_values();
  for (int k = 0; k < 300'000; ++k) run.add_control_values(0.001 * k);
  EXPECT_EQ(Evaluate(run).finished.reason(), "exit 0 with 0 of 300000 states");
}

TEST_F(ProgramsTest, Limits) {
  const auto reason = [this](const std::string& script, const auto& set) {
    v1::ProgramRun run = Shell(Answers(0, 1) + script);
    set(*run.mutable_limits());
    Outcome outcome = Evaluate(run);
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED) << script;
    EXPECT_LT(outcome.seconds, 8) << script;
    run.set_limit_diverges(true);
    outcome = Evaluate(run);
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED) << script;
    return outcome.finished.reason();
  };
  EXPECT_EQ(reason("sleep 100", [](auto& limits) { limits.set_wall(0.3); }),
            "came to its wall limit of 0.3 s, with 1 of 3 states");
  EXPECT_EQ(reason("sleep 100", [](auto& limits) { limits.set_silence(0.3); }),
            "came to its silence limit: no state for 0.3 s, with 1 of 3 states");
  EXPECT_EQ(reason("while :; do echo hello; sleep 0.05; done",
                   [](auto& limits) { limits.set_silence(0.3); }),
            "came to its silence limit: no state for 0.3 s, with 1 of 3 states");
  // What a child of the program holds counts as well.
  EXPECT_THAT(reason("x=$(sleep 100) & python3 -c 'import time; x = bytearray(200_000_000); "
                     "time.sleep(100)'; true",
                     [](auto& limits) { limits.set_memory(1e8); }),
              StartsWith("came to its memory limit: "));
  // None of its files is above the limit, their sum is: after the third or the fourth of them.
  EXPECT_THAT(
      reason("for k in 1 2 3 4; do head -c 400000 /dev/zero > $k; done; sleep 100",
             [](auto& limits) { limits.set_disk(1e6); }),
      MatchesRegex("came to its disk limit: 1\\.[0-6][0-9]* MB of 1 MB, with 1 of 3 states"));
  EXPECT_THAT(
      reason("exec head -c 4000000 /dev/zero > big", [](auto& limits) { limits.set_disk(1e6); }),
      StartsWith("came to its disk limit: 1 MB of 1 MB"));
}

TEST_F(ProgramsTest, SilenceCountsFromTheStart) {
  v1::ProgramRun run = Shell("sleep 0.25\n" + Answers(0, 1) + "sleep 0.25\n" + Answers(1, 2) +
                             "sleep 0.25\n" + Answers(2, 3));
  run.mutable_limits()->set_silence(0.5);
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  run = Shell("sleep 100");
  run.mutable_limits()->set_silence(0.2);
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
}

TEST_F(ProgramsTest, AStopEndsIt) {
  const StopLater stop(milliseconds(300));
  const Outcome outcome = Evaluate(Shell(Answers(0, 1) + "sleep 100"), stop.token());
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_STOPPED);
  EXPECT_EQ(outcome.finished.states(), 1);
  EXPECT_LT(outcome.seconds, 3);
  std::stop_source before;
  before.request_stop();
  EXPECT_EQ(Evaluate(Shell("sleep 100"), before.get_token()).finished.outcome(),
            v1::Finished::OUTCOME_STOPPED);
}

TEST_F(ProgramsTest, NothingOfARunStays) {
  const Outcome outcome = Evaluate(Shell("sleep 100 & echo $! >&2; pwd >&2; touch a; exit 1"));
  std::istringstream words(outcome.finished.words());
  pid_t pid = 0;
  std::string folder;
  words >> pid >> folder;
  ASSERT_GT(pid, 0);
  EXPECT_TRUE(EndsSoon(pid));
  EXPECT_THAT(folder, StartsWith(folder_.path()));
  EXPECT_FALSE(std::filesystem::exists(folder));
}

TEST_F(ProgramsTest, WhatMayRunHere) {
  const auto end = [this](v1::ProgramRun run, const std::string& program) {
    run.set_command(0, program);
    return Evaluate(run).finished;
  };
  const v1::ProgramRun good = Shell(Answers(0, 3));
  TheseMay({"sh", "no-such-program"});
  EXPECT_THAT(programs_->AllowedNames(), ElementsAre(StartsWith("/"), "sh"));
  EXPECT_THAT(programs_->NotFound(), ElementsAre("no-such-program"));
  EXPECT_EQ(end(good, "sh").outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_EQ(end(good, programs_->AllowedNames()[0]).outcome(), v1::Finished::OUTCOME_COMPLETED);
  v1::Finished refused = end(good, "bash");
  EXPECT_EQ(refused.outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_THAT(refused.reason(),
              StartsWith("bash is not among the programs that this worker may run"));
  refused = end(good, "no-such-program");
  EXPECT_EQ(refused.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_EQ(refused.reason(), "no-such-program: not found on this node");
  TheseMay({});
  EXPECT_THAT(programs_->AllowedNames(), IsEmpty());
  EXPECT_EQ(end(good, "sh").outcome(), v1::Finished::OUTCOME_FAILED);
  TheseMay({"*"});
  EXPECT_THAT(programs_->AllowedNames(), ElementsAre("*"));
  EXPECT_EQ(end(good, "sh").outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_EQ(end(good, "/bin/sh").outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_EQ(end(good, "no-such-program").reason(), "no-such-program: not found on this node");
  EXPECT_EQ(end(good, "../sh").outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_EQ(end(good, "").outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
}

TEST_F(ProgramsTest, ABroughtProgramNeedsThatAnyIsAllowed) {
  v1::ProgramRun run = Shell("");
  run.clear_command();
  run.add_command("model");
  Bring(run, "model", "#!/bin/sh\n" + Answers(0, 3));
  run.mutable_files(0)->set_executable(true);
  TheseMay({"sh"});
  for (const char* name : {"model", "./model", "{scratch}/model"}) {
    run.set_command(0, name);
    const v1::Finished refused = Evaluate(run).finished;
    EXPECT_EQ(refused.outcome(), v1::Finished::OUTCOME_FAILED);
    EXPECT_THAT(refused.reason(), HasSubstr("--allow-command '*'"));
  }
  TheseMay({"*"});
  for (const char* name : {"model", "./model", "{scratch}/model"}) {
    run.set_command(0, name);
    EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << name;
  }
  run.mutable_files(0)->set_executable(false);
  EXPECT_THAT(Evaluate(run).finished.reason(), HasSubstr("without the right to be executed"));
}

// A file in the folder must not take the place of a program that is allowed by its name.
TEST_F(ProgramsTest, AnAllowedNameIsNeverAFileOfTheRun) {
  v1::ProgramRun run = Shell(Answers(0, 3));
  Bring(run, "sh", "#!/bin/sh\nexit 9\n");
  run.mutable_files(0)->set_executable(true);
  TheseMay({"sh"});
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  Programs inside({.fetch = contents_.AsFetch(),
                   .scratch = folder_.path(),
                   .allowed = {"model"},
                   .path = folder_.path() + "::.:relative",
                   .times = times_});
  EXPECT_THAT(inside.AllowedNames(), IsEmpty());
}

TEST_F(ProgramsTest, TemplatesAndArgumentsAreFilled) {
  v1::ProgramRun run = Shell(
      "echo \"{\\\"load_step\\\": 0, \\\"y\\\": {a}}\"; . ./deep/in; [ {scratch} = $PWD ] || exit "
      "1",
      2);
  Bring(run, "deep/in", "echo '{\"load_step\": 1, \"y\": {radius}}' # ${a} {other}\n");
  run.mutable_files(0)->set_is_template(true);
  (*run.mutable_parameters())["a"] = 0.1;
  run.set_settings("{\"radius\": 2.5e-3}");
  const Outcome outcome = Evaluate(run);
  ASSERT_EQ(outcome.states.size(), 2U) << outcome.finished.reason() << outcome.finished.words();
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_EQ(outcome.states[0].values(0), 0.1);
  EXPECT_EQ(outcome.states[1].values(0), 2.5e-3);
}

TEST_F(ProgramsTest, WhatIsTheNodesFaultAndWhatTheCampaigns) {
  v1::ProgramRun run = Shell(Answers(0, 3));
  v1::ProgramFile& file = *run.add_files();
  file.set_name("a");
  file.set_digest(std::string(64, '0'));
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_FAILED);
  file.set_name("../a");
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  std::ofstream(folder_.path() + "/file") << "x";
  Programs nowhere({.fetch = contents_.AsFetch(),
                    .scratch = folder_.path() + "/file/scratch",
                    .allowed = {"sh"},
                    .path = {},
                    .times = times_});
  const v1::Finished failed =
      nowhere.Evaluate(Shell(Answers(0, 3)), 1, [](const v1::State&) {}, {});
  EXPECT_EQ(failed.outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_THAT(failed.reason(), HasSubstr("/file/scratch"));
}

TEST_F(ProgramsTest, StatesFromATable) {
  v1::ProgramRun run = Shell(
      "echo '{not an answer'; echo '# x y' > out.txt; for k in 1 2 3; do sleep 0.1; "
      "printf \"0 $k\" >> out.txt; sleep 0.1; echo 5 >> out.txt; done; exit 1");
  v1::ProgramTable& table = *run.mutable_states();
  table.set_file("out.txt");
  v1::ProgramColumn& column = *table.add_columns();
  column.set_name("y");
  column.set_column("y");
  column.set_factor(2);
  run.mutable_limits()->set_silence(0.5);
  Outcome outcome = Evaluate(run);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
      << outcome.finished.reason();
  ASSERT_EQ(outcome.states.size(), 3U);
  EXPECT_EQ(outcome.states[1].values(0), 50);
  EXPECT_EQ(outcome.report.ignored_lines, 1);
  run.set_command(2, "exit 0");
  EXPECT_EQ(Evaluate(run).finished.reason(), "exit 0 with 0 of 3 states; it wrote no out.txt");
  run.set_command(2, "mkdir out.txt; sleep 100");
  EXPECT_EQ(Evaluate(run).finished.reason(), "out.txt is no regular file");
  run.set_command(2, "printf 'y\\n1\\n2\\n3' > out.txt");
  EXPECT_EQ(Evaluate(run).states.size(), 3U);
  run.set_command(2, "printf 'y\\n1\\n2\\n3' > out.txt; kill -SEGV $$");
  EXPECT_EQ(Evaluate(run).finished.reason(), "ended by SIGSEGV with 2 of 3 states")
      << "the last number may have been cut";
  run.set_command(2, "printf 'y\\n1\\n2\\n' > out.txt; sleep 0.2; echo y > out.txt; sleep 100");
  EXPECT_THAT(Evaluate(run).finished.reason(), HasSubstr("out.txt has become shorter"));
  table.set_file("../out.txt");
  EXPECT_EQ(Evaluate(run).finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
}

TEST_F(ProgramsTest, StatesThatComeAllAtOnceAreNoticed) {
  const Outcome late = Evaluate(Shell("sleep 1.1\n" + Answers(0, 4), 4));
  EXPECT_TRUE(late.report.all_at_once);
  const Outcome one_by_one = Evaluate(Shell(Answers(0, 1) + "sleep 1.1\n" + Answers(1, 4), 4));
  EXPECT_FALSE(one_by_one.report.all_at_once);
}

TEST_F(ProgramsTest, FilesStayWithARun) {
  v1::ProgramRun run = Shell("mkdir d; echo one > d/a; mkfifo pipe\n" + Answers(0, 3));
  for (const char* name : {"d/a", "missing", "pipe", "../up"}) run.add_keep(name);
  const Outcome outcome = Evaluate(run);
  ASSERT_EQ(outcome.report.kept.size(), 1U);
  EXPECT_EQ(outcome.report.kept[0].name, "d/a");
  EXPECT_EQ(outcome.report.kept[0].content, "one\n");
  EXPECT_THAT(outcome.report.not_kept,
              ElementsAre(Pair("../up", HasSubstr("is no name")), Pair("missing", "is not there"),
                          Pair("pipe", "is no regular file")));
  EXPECT_EQ(outcome.finished.kept_size(), 0) << "nobody takes them";
}

TEST_F(ProgramsTest, FilesAreHandedOverAndWhatIsNotTakenIsNoFailure) {
  std::vector<std::string> put;
  put_ = [&put](const std::string& content, const std::stop_token&) {
    if (content.size() > 10) return absl::ResourceExhaustedError("too large");
    put.push_back(content);
    return absl::OkStatus();
  };
  v1::ProgramRun run =
      Shell("echo one > a; echo one and two and three > b\n" + Answers(0, 3) + "exit 1");
  for (const char* name : {"a", "b", "missing"}) run.add_keep(name);
  const v1::Finished finished = Evaluate(run).finished;
  EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << finished.reason();
  EXPECT_THAT(put, ElementsAre("one\n"));
  ASSERT_EQ(finished.kept_size(), 3);
  EXPECT_EQ(finished.kept(0).digest(), rpc::Sha256Hex("one\n"));
  EXPECT_THAT(finished.kept(0).reason(), IsEmpty());
  EXPECT_THAT(finished.kept(1).digest(), IsEmpty());
  EXPECT_THAT(finished.kept(1).reason(), HasSubstr("too large"));
  EXPECT_EQ(finished.kept(2).reason(), "is not there");
}

TEST_F(ProgramsTest, WhatAnEarlierRunHasLeftDoesNotStayWithTheNext) {
  v1::ProgramRun run = Python(R"(
import json, os, sys
for n, line in enumerate(sys.stdin):
    request = json.loads(line)
    if n == 0:
        open('a', 'w').write('first')
    for k in range(3):
        print(json.dumps({'run': request['run'], 'load_step': k, 'y': 0}))
    print(json.dumps({'run': request['run'], 'end': 'complete'}))
)");
  run.set_persistent(true);
  run.add_keep("a");
  EXPECT_EQ(Evaluate(run).report.kept.size(), 1U);
  const Outcome second = Evaluate(run);
  EXPECT_EQ(second.finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << second.finished.reason();
  EXPECT_THAT(second.report.kept, IsEmpty());
  EXPECT_THAT(second.report.not_kept, ElementsAre(Pair("a", "is not there")));
}

TEST_F(ProgramsTest, InputStaysOpenWhereCheckpointsAreUnderstood) {
  v1::ProgramRun run =
      Shell("read line; echo '{\"checkpoint\": \"c\"}'\n" + Answers(0, 3) + "cat; echo ended >&2");
  run.set_checkpoint(true);
  const Outcome outcome = Evaluate(run);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
      << outcome.finished.reason();
  EXPECT_THAT(outcome.report.checkpoints, ElementsAre("c"));
  EXPECT_EQ(outcome.report.words, "ended\n") << "after the last state nothing more is asked";
}

TEST_F(ProgramsTest, RunsAtOnceAreApart) {
  slots_ = 4;
  TheseMay({"*"});
  v1::ProgramRun run = Shell("");
  run.clear_command();
  run.add_command("./model");
  Bring(run, "model", "#!/bin/sh\n[ ! -e mark ] || exit 1\ntouch mark\n" + Answers(0, 3));
  run.mutable_files(0)->set_executable(true);
  std::atomic<int> completed = 0;
  {
    std::vector<std::jthread> slots;
    for (int slot = 0; slot < 4; ++slot) {
      slots.emplace_back([&, slot] {
        for (int k = 0; k < 25; ++k) {
          const v1::Finished finished =
              programs_->Evaluate(run, 100 * slot + k + 1, [](const v1::State&) {}, {});
          completed += finished.outcome() == v1::Finished::OUTCOME_COMPLETED ? 1 : 0;
          EXPECT_EQ(finished.reason(), "");
        }
      });
    }
  }
  EXPECT_EQ(completed, 100);
  EXPECT_EQ(contents_.fetches(), 1);
}

/// Answers a request per line; `what` of the parameters says how.
constexpr const char* kServer = R"(
import json, os, select, sys, time
def say(**line):
    print(json.dumps(line), flush=True)
for text in iter(sys.stdin.readline, ''):
    asked = json.loads(text)
    if 'stop' in asked: continue
    run, what = asked['run'], asked['parameters']['what']
    if what == 9:  # says what has been asked so far
        say(run=run, end='diverged', reason='pid %d' % os.getpid())
        continue
    say(run='0', load_step=99)
    for k, x in enumerate(asked['control']['values']):
        if k == 2 and what == 1: os.kill(os.getpid(), 11)
        if k == 2 and what == 2: sys.exit(3)
        if k == 2 and what in (3, 4):
            if what == 3:
                while 'stop' not in json.loads(sys.stdin.readline()): pass
            else:
                time.sleep(100)
            say(run=run, load_step=k, y=1)
            break
        if k == 2 and what == 5:
            say(run=run, load_step=k, y=float('nan'))
            while 'stop' not in json.loads(sys.stdin.readline()): pass
            break
        if k == 2 and what == 6: break
        say(run=run, load_step=k, y=os.getpid())
    if what != 7: say(run=run, end='complete')
)";

class PersistentProgram : public ProgramsTest {
 protected:
  Outcome Ask(int what, std::stop_token stop = {}) {
    v1::ProgramRun run = Python(kServer);
    run.set_persistent(true);
    run.set_version(version_);
    (*run.mutable_parameters())["what"] = what;
    return Evaluate(run, stop);
  }
  /// Of the process that answers now.
  pid_t Pid() {
    const std::string reason = Ask(9).finished.reason();
    EXPECT_THAT(reason, StartsWith("pid "));
    return reason.size() > 4 ? std::stoi(reason.substr(4)) : 0;
  }
  std::string version_ = "1";
};

TEST_F(PersistentProgram, AnswersOneRunAfterTheOther) {
  const pid_t pid = Pid();
  for (int k = 0; k < 3; ++k) {
    const Outcome outcome = Ask(0);
    EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED)
        << outcome.finished.reason() << outcome.finished.words();
    ASSERT_EQ(outcome.states.size(), 3U);
    EXPECT_EQ(outcome.states[0].values(0), pid);
    EXPECT_LT(outcome.finished.core_seconds(), 1);
  }
  EXPECT_EQ(Pid(), pid);
  programs_.reset();
  EXPECT_TRUE(EndsSoon(pid));
}

TEST_F(PersistentProgram, IsStartedAnewAfterItsDeath) {
  const pid_t first = Pid();
  Outcome outcome = Ask(1);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_EQ(outcome.finished.reason(), "ended by SIGSEGV with 2 of 3 states");
  const pid_t second = Pid();
  EXPECT_NE(second, first);
  outcome = Ask(2);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED);
  const pid_t third = Pid();
  EXPECT_NE(third, second);
  kill(third, SIGKILL);  // while it waits
  std::this_thread::sleep_for(milliseconds(50));
  EXPECT_EQ(Ask(0).finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
}

TEST_F(PersistentProgram, IsToldToStopARun) {
  const pid_t pid = Pid();
  const StopLater stop(milliseconds(300));
  Outcome outcome = Ask(3, stop.token());
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_STOPPED);
  EXPECT_EQ(outcome.states.size(), 2U) << "what comes after a stop does not count";
  EXPECT_EQ(Pid(), pid) << "it has answered the stop";
  const StopLater again(milliseconds(300));
  outcome = Ask(4, again.token());
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_STOPPED);
  EXPECT_TRUE(EndsSoon(pid)) << "it has not";
  EXPECT_NE(Pid(), pid);
}

TEST_F(PersistentProgram, StaysAfterARunThatDivergedOrSaidTooLittle) {
  const pid_t pid = Pid();
  Outcome outcome = Ask(5);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_DIVERGED);
  EXPECT_EQ(outcome.finished.reason(), "y is NaN at load step 2");
  outcome = Ask(6);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_THAT(outcome.finished.reason(), HasSubstr("complete with 2 of 3 states"));
  EXPECT_EQ(Pid(), pid);
}

TEST_F(PersistentProgram, ThatSaysNoEndIsEndedAndItsRunIsComplete) {
  const pid_t pid = Pid();
  const Outcome outcome = Ask(7);
  EXPECT_EQ(outcome.finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_TRUE(EndsSoon(pid));
}

TEST_F(PersistentProgram, GivesWayToOneThatIsAskedFor) {
  const pid_t pid = Pid();
  version_ = "2";
  EXPECT_NE(Pid(), pid);
  EXPECT_TRUE(EndsSoon(pid));
}

TEST_F(PersistentProgram, EndsWhenNobodyAsks) {
  times_.longest_idle = milliseconds(300);
  EXPECT_TRUE(EndsSoon(Pid()));
}

TEST_F(PersistentProgram, HasATemplatePerRun) {
  const auto asked = [this](double value) {
    v1::ProgramRun run = Python(R"(
import json, sys
for text in iter(sys.stdin.readline, ''):
    asked = json.loads(text)
    assert asked == json.load(open('request.json'))
    print(json.dumps({'run': asked['run'], 'load_step': 0, 'y': float(open('in').read())}))
    print(json.dumps({'run': asked['run'], 'end': 'complete'}))
)",
                                1);
    run.set_persistent(true);
    Bring(run, "in", "{a}");
    run.mutable_files(1)->set_is_template(true);
    (*run.mutable_parameters())["a"] = value;
    const Outcome outcome = Evaluate(run);
    return outcome.states.size() == 1 ? outcome.states[0].values(0) : -1;
  };
  EXPECT_EQ(asked(1.5), 1.5);
  EXPECT_EQ(asked(0.1), 0.1);
}

TEST_F(PersistentProgram, HasNoTable) {
  v1::ProgramRun run = Shell("");
  run.set_persistent(true);
  run.mutable_states()->set_file("a");
  EXPECT_THAT(Evaluate(run).finished.reason(), HasSubstr("exclude each other"));
}

}  // namespace
}  // namespace calib::worker
