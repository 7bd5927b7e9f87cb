#include "server/ctl/slurm/worker_array.h"

#include <algorithm>
#include <cstddef>
#include <map>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "proto/rpc/address.h"

namespace calib::ctl {
namespace {

constexpr char kNamePrefix[] = "slurm-";
// Of the 30 seconds (KillWait) between SIGTERM and SIGKILL of a job that is cancelled, five are
// left for last words.
constexpr int kDrainSeconds = 25;
// Before the limit of time, by when a worker is told: the same seconds, whose signal Slurm may send
// up to that much late or early.
constexpr int kWarningSeconds = 60;

/// A word of a #SBATCH line, which is no shell's: letters, digits and what names have.
bool IsWord(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) ||
           std::string_view("-_.,:@+/").find(static_cast<char>(c)) != std::string_view::npos;
  });
}

std::string Quoted(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"'", "'\\''"}}), "'");
}

}  // namespace

absl::Status CheckArray(const WorkerArray& array) {
  std::vector<std::string> problems;
  if (!rpc::SocketPathOf(array.server).empty()) {
    problems.push_back(absl::StrCat("no other node reaches ", array.server,
                                    "; --server HOST:PORT says where calibd listens"));
  }
  if (!IsWord(array.partition)) {
    problems.push_back(absl::StrCat("--partition \"", array.partition,
                                    "\" is no name of a partition, as `sinfo` lists them"));
  }
  const bool counts = array.time.find_first_not_of("0123456789:-") == std::string::npos;
  if (!counts && array.time != "UNLIMITED") {
    problems.push_back(absl::StrCat("--time \"", array.time,
                                    "\" is no time of Slurm: MINUTES, HOURS:MINUTES:SECONDS, "
                                    "DAYS-HOURS or UNLIMITED"));
  }
  return problems.empty() ? absl::OkStatus()
                          : absl::InvalidArgumentError(absl::StrJoin(problems, "\n"));
}

std::string JobNameOf(const WorkerArray& array) { return absl::StrCat("calib@", array.server); }

std::string BatchScript(const WorkerArray& array, int count) {
  std::string script = absl::StrCat(
      "#!/bin/sh\n# Workers of calibd at ", array.server,
      ", as `calibctl scale --slurm` starts them.\n", "#SBATCH --job-name=", JobNameOf(array),
      "\n#SBATCH --array=1-", count, "\n#SBATCH --ntasks=1\n#SBATCH --cpus-per-task=", array.cpus,
      "\n#SBATCH --output=calib-worker-%A_%a.log\n#SBATCH --no-requeue\n",
      "#SBATCH --signal=B:TERM@", kWarningSeconds, "\n");
  if (!array.partition.empty())
    absl::StrAppend(&script, "#SBATCH --partition=", array.partition, "\n");
  if (!array.time.empty()) absl::StrAppend(&script, "#SBATCH --time=", array.time, "\n");
  absl::StrAppend(&script, "exec ", Quoted(array.program), " --server ", Quoted(array.server),
                  " --name \"", kNamePrefix, "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}\"",
                  " \\\n  --slots \"${SLURM_CPUS_PER_TASK:-", array.cpus, "}\" --drain-within ",
                  kDrainSeconds);
  if (!array.tls.empty()) absl::StrAppend(&script, " --tls ", Quoted(array.tls));
  if (!array.token.empty()) absl::StrAppend(&script, " --token ", Quoted(array.token));
  return absl::StrCat(script, "\n");
}

std::vector<std::string> QueueCommand(const WorkerArray& array) {
  return {
      "squeue",        "--noheader", "--me", "--array", absl::StrCat("--name=", JobNameOf(array)),
      "--format=%i %t"};
}

absl::StatusOr<std::vector<SlurmJob>> JobsOf(const std::string& answer) {
  std::vector<SlurmJob> jobs;
  for (const std::string& line :
       std::vector<std::string>(absl::StrSplit(answer, '\n', absl::SkipWhitespace()))) {
    const std::vector<std::string> words = absl::StrSplit(line, ' ', absl::SkipEmpty());
    if (words.size() != 2) {
      return absl::InternalError(absl::StrCat("squeue answers \"", line, "\", which is no job"));
    }
    const std::string& state = words[1];
    // Configuring, pending, running, suspended; all others are over or about to be.
    if (state == "PD" || state == "CF" || state == "R" || state == "S") {
      jobs.push_back({.id = words[0], .pending = state == "PD"});
    }
  }
  return jobs;
}

std::string WorkerOf(const SlurmJob& job) { return absl::StrCat(kNamePrefix, job.id); }

int OpenSamples(const std::vector<v1::CampaignStatus>& campaigns) {
  int open = 0;
  for (const v1::CampaignStatus& campaign : campaigns) {
    if (campaign.state() != "queued" && campaign.state() != "running") continue;
    const int done = campaign.phase() == "validating" ? 0 : campaign.samples_done();
    open += std::max(1, campaign.samples() - done);
  }
  return open;
}

Change ChangeFor(const Demand& demand, const std::vector<SlurmJob>& jobs,
                 const std::vector<v1::WorkerInfo>& workers) {
  std::map<std::string, const v1::WorkerInfo*> by_name;
  for (const v1::WorkerInfo& worker : workers) by_name[worker.name()] = &worker;
  std::vector<std::string> pending, idle, busy;  // what may go, the last first
  for (const SlurmJob& job : jobs) {
    const auto found = by_name.find(WorkerOf(job));
    const v1::WorkerInfo* const worker = found == by_name.end() ? nullptr : found->second;
    if (job.pending) {
      pending.push_back(job.id);
    } else if (worker == nullptr) {
      busy.push_back(WorkerOf(job));  // it has not come yet, and is not known to the server
    } else if (!worker->draining() && !worker->left()) {
      (worker->busy() > 0 ? busy : idle).push_back(worker->name());
    }
  }
  Change change;
  change.there = static_cast<int>(pending.size() + idle.size() + busy.size());
  change.wanted = std::min(demand.most, (demand.open + demand.cpus - 1) / demand.cpus);
  change.start = std::max(0, change.wanted - change.there);
  int surplus = std::max(0, change.there - change.wanted);
  const auto take = [&surplus](std::vector<std::string>& from, std::vector<std::string>& to,
                               int most) {
    for (; surplus > 0 && most > 0 && !from.empty(); --surplus, --most) {
      to.push_back(from.back());
      from.pop_back();
    }
  };
  take(pending, change.cancel, surplus);
  take(idle, change.drain, surplus);
  const int left = static_cast<int>(pending.size() + idle.size() + busy.size());
  std::erase_if(busy, [&](const std::string& name) { return by_name.count(name) == 0; });
  take(busy, change.drain, left - demand.most);
  return change;
}

}  // namespace calib::ctl
