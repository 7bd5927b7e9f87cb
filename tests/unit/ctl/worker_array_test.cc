#include "server/ctl/slurm/worker_array.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/ctl/slurm/program_output.h"

namespace calib::ctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

WorkerArray Head() { return {.server = "head:7443", .program = "/opt/c a/calib-worker"}; }

v1::WorkerInfo Worker(const std::string& name, int busy) {
  v1::WorkerInfo worker;
  worker.set_name(name);
  worker.set_busy(busy);
  return worker;
}

TEST(WorkerArray, ScriptSaysWhatWasAsked) {
  WorkerArray array = Head();
  EXPECT_THAT(BatchScript(array, 7), HasSubstr("\n#SBATCH --array=1-7\n"));
  EXPECT_THAT(BatchScript(array, 7), HasSubstr("\nexec '/opt/c a/calib-worker' --server "));
  for (const char* option : {"--partition", "--time", "--tls", "--token"}) {
    EXPECT_THAT(BatchScript(array, 7), Not(HasSubstr(option)));
  }
  array.partition = "short,long";
  array.time = "1-12:30";
  array.tls = "/t/l's";
  array.token = "/t/token";
  array.cpus = 4;
  const std::string script = BatchScript(array, 1);
  for (const char* part :
       {"\n#SBATCH --partition=short,long\n", "\n#SBATCH --time=1-12:30\n",
        "\n#SBATCH --cpus-per-task=4\n", "\n#SBATCH --signal=B:TERM@60\n",
        "\n#SBATCH --job-name=calib@head:7443\n", " --tls '/t/l'\\''s'", " --token '/t/token'"}) {
    EXPECT_THAT(script, HasSubstr(part));
  }
}

TEST(WorkerArray, WhatSlurmCouldNotReadIsRefusedInOneGo) {
  EXPECT_TRUE(CheckArray(Head()).ok());
  WorkerArray array = Head();
  array.time = "UNLIMITED";
  EXPECT_TRUE(CheckArray(array).ok());
  array = {.server = "unix:/run/c.sock", .partition = "a b\n#SBATCH", .time = "1h"};
  const std::string problems(CheckArray(array).message());
  EXPECT_THAT(problems, HasSubstr("unix:/run/c.sock"));
  EXPECT_THAT(problems, HasSubstr("\n--partition \"a b"));
  EXPECT_THAT(problems, HasSubstr("\n--time \"1h\""));
}

TEST(WorkerArray, JobsAreThoseThatPendOrRun) {
  const auto jobs = JobsOf("17_1 R\n17_2 PD\n9_4 CG\n  18_1 CF\n18_2 TO\n");
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  std::vector<std::string> told;
  for (const SlurmJob& job : *jobs) told.push_back(job.id + (job.pending ? "?" : ""));
  EXPECT_THAT(told, ElementsAre("17_1", "17_2?", "18_1"));
  EXPECT_EQ(WorkerOf(jobs->front()), "slurm-17_1");
  EXPECT_FALSE(JobsOf("slurm_load_jobs error: no controller\n").ok());
}

TEST(WorkerArray, OpenSamplesAreOfCampaignsThatRun) {
  const auto campaign = [](const char* state, const char* phase, int samples, int done) {
    v1::CampaignStatus status;
    status.set_state(state);
    status.set_phase(phase);
    status.set_samples(samples);
    status.set_samples_done(done);
    return status;
  };
  EXPECT_EQ(OpenSamples({}), 0);
  EXPECT_EQ(
      OpenSamples({campaign("finished", "done", 40, 30), campaign("paused", "calibrating", 40, 0)}),
      0);
  EXPECT_EQ(OpenSamples({campaign("running", "calibrating", 40, 30)}), 10);
  EXPECT_EQ(OpenSamples({campaign("running", "calibrating", 40, 40)}), 1) << "more will follow";
  EXPECT_EQ(OpenSamples({campaign("queued", "calibrating", 0, 0)}), 1);
  EXPECT_EQ(OpenSamples({campaign("running", "validating", 40, 40)}), 40);
}

TEST(WorkerArray, GrowsToTheWorkButNotBeyondTheMost) {
  const std::vector<SlurmJob> one = {{.id = "3_1"}};
  EXPECT_EQ(ChangeFor({.most = 8, .open = 5, .cpus = 1}, one, {Worker("slurm-3_1", 1)}).start, 4);
  EXPECT_EQ(ChangeFor({.most = 8, .open = 50, .cpus = 1}, one, {}).start, 7);
  EXPECT_EQ(ChangeFor({.most = 8, .open = 5, .cpus = 4}, one, {}).start, 1) << "of four slots each";
  v1::WorkerInfo draining = Worker("slurm-3_1", 1);
  draining.set_draining(true);
  EXPECT_EQ(ChangeFor({.most = 2, .open = 9, .cpus = 1}, one, {draining}).start, 2);
}

TEST(WorkerArray, ShrinksFromWhatHasNotBegunToWhatIsIdle) {
  const std::vector<SlurmJob> jobs = {
      {.id = "3_1"}, {.id = "3_2"}, {.id = "3_3"}, {.id = "4_1", .pending = true}};
  const std::vector<v1::WorkerInfo> workers = {Worker("slurm-3_1", 0), Worker("slurm-3_2", 1),
                                               Worker("slurm-3_3", 0), Worker("mine", 0)};
  Change change = ChangeFor({.most = 8, .open = 3, .cpus = 1}, jobs, workers);
  EXPECT_THAT(change.cancel, ElementsAre("4_1"));
  EXPECT_THAT(change.drain, IsEmpty());
  change = ChangeFor({.most = 8, .open = 1, .cpus = 1}, jobs, workers);
  EXPECT_THAT(change.cancel, ElementsAre("4_1"));
  EXPECT_THAT(change.drain, ElementsAre("slurm-3_3", "slurm-3_1"));
  change = ChangeFor({.most = 8, .open = 0, .cpus = 1}, jobs, workers);
  EXPECT_THAT(change.drain, ElementsAre("slurm-3_3", "slurm-3_1")) << "3_2 computes";
  change = ChangeFor({.most = 0, .open = 9, .cpus = 1}, jobs, workers);
  EXPECT_THAT(change.drain, ElementsAre("slurm-3_3", "slurm-3_1", "slurm-3_2"));
  EXPECT_EQ(change.start, 0);
}

TEST(ProgramOutput, IsItsAnswerOrWhyThereIsNone) {
  EXPECT_EQ(OutputOf({"printf", "a\nb"}).value_or(""), "a\nb");
  const auto failed = OutputOf({"sh", "-c", "echo first >&2; echo last >&2; exit 3"});
  EXPECT_EQ(failed.status().message(), "sh failed: last");
  EXPECT_TRUE(absl::IsNotFound(OutputOf({"no-such-program-of-slurm"}).status()));
}

}  // namespace
}  // namespace calib::ctl
