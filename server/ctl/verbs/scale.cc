// As many workers on a cluster as there is work for.
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "server/client/child_process.h"
#include "server/client/session.h"
#include "server/client/temporary_folder.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/slurm/program_output.h"
#include "server/ctl/slurm/worker_array.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

constexpr int kMostWorkers = 10'000;
constexpr int kMostCpus = 1024;  // slots of a worker

struct ScaleOptions {
  int most = 0;
  WorkerArray array{};
  bool dry_run = false;
};

void Declare(OptionList& list, ScaleOptions& options) {
  list.BoundedNumber("--slurm", options.most, {.min = 0, .max = kMostWorkers},
                     "workers at most, each a job of Slurm; 0: all are drained")
      .Required();
  list.Text("--partition", options.array.partition, "where they run [the cluster's default]");
  list.Text("--time", options.array.time,
            "limit of each, as Slurm writes it: 30, 2:00:00 or 1-12 [the partition's]");
  list.BoundedNumber("--cpus", options.array.cpus, {.min = 1, .max = kMostCpus},
                     "processors of each, which runs as many evaluations at a time [1]");
  list.Text("--worker-tls", options.array.tls,
            "folder, on the nodes, of a certificate of the role worker");
  list.Flag("--dry-run", options.dry_run,
            "prints the batch script of all; neither server nor Slurm is asked");
}

bool IsSet(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

/// What the options and those of every verb say together.
absl::StatusOr<WorkerArray> ArrayOf(const CommonOptions& common, const ScaleOptions& options) {
  WorkerArray array = options.array;
  array.server = common.server.address;
  if (!common.server.state.empty()) {
    return absl::InvalidArgumentError(
        "--state is a server of this command alone; workers on a cluster need a calibd, --server "
        "HOST:PORT");
  }
  if (array.tls.empty() && (!common.server.tls.empty() || IsSet("CALIB_TLS"))) {
    return absl::InvalidArgumentError(
        "a server with certificates lets in workers with one of the role worker: --worker-tls "
        "FOLDER");
  }
  if (!common.server.token.empty()) {
    array.token = std::filesystem::absolute(common.server.token).string();
  }
  ASSIGN_OR_RETURN(array.program, client::FindWorkerProgram());
  RETURN_IF_ERROR(CheckArray(array));
  if (rpc::IsLoopback(array.server)) {
    std::cerr << "calibctl: on another node " << array.server
              << " is that node itself; --server says where calibd is\n";
  }
  return array;
}

/// The number of the new array.
absl::StatusOr<std::string> Submit(const WorkerArray& array, int count) {
  ASSIGN_OR_RETURN(const client::TemporaryFolder folder, client::TemporaryFolder::Make());
  const std::string script = folder.path() + "/workers.sh";
  RETURN_IF_ERROR(WriteFile(script, BatchScript(array, count)));
  ASSIGN_OR_RETURN(const std::string answer, OutputOf({"sbatch", "--parsable", script}));
  return std::string(absl::StripAsciiWhitespace(answer.substr(0, answer.find(';'))));
}

void Print(const CommonOptions& common, const Change& change, const std::string& job) {
  if (common.json) {
    const nlohmann::ordered_json answer = {{"wanted", change.wanted},    {"there", change.there},
                                           {"started", change.start},    {"job", job},
                                           {"cancelled", change.cancel}, {"drained", change.drain}};
    std::cout << answer.dump(2) << "\n";
    return;
  }
  std::cout << change.there << " workers, " << change.wanted << " wanted";
  if (change.start > 0) std::cout << ": " << change.start << " more, job " << job;
  if (!change.cancel.empty()) std::cout << ": " << change.cancel.size() << " that wait cancelled";
  if (!change.drain.empty()) std::cout << ": " << change.drain.size() << " drained";
  std::cout << ".\n";
}

absl::StatusOr<int> Scale(const CommonOptions& common, const ScaleOptions& options) {
  const auto array = ArrayOf(common, options);
  if (absl::IsInvalidArgument(array.status())) {
    for (const auto& problem : absl::StrSplit(std::string(array.status().message()), '\n')) {
      std::cerr << "calibctl: " << problem << "\n";
    }
    return kBadInput;
  }
  RETURN_IF_ERROR(array.status());
  if (options.dry_run) {
    if (options.most == 0) {
      std::cerr << "calibctl: --slurm 0 starts nothing, so there is no script of it\n";
      return kBadInput;
    }
    std::cout << BatchScript(*array, options.most);
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  ASSIGN_OR_RETURN(const auto campaigns, client.List());
  ASSIGN_OR_RETURN(const auto workers, client.ListWorkers());
  ASSIGN_OR_RETURN(const std::string queue, OutputOf(QueueCommand(*array)));
  ASSIGN_OR_RETURN(const auto jobs, JobsOf(queue));
  const Change change = ChangeFor(
      {.most = options.most, .open = OpenSamples(campaigns), .cpus = array->cpus}, jobs, workers);
  std::string job;
  if (change.start > 0) {
    ASSIGN_OR_RETURN(job, Submit(*array, change.start));
  }
  for (const std::string& id : change.cancel) {
    // One that has begun meanwhile stays, and is drained the next time.
    RETURN_IF_ERROR(OutputOf({"scancel", "--state=PENDING", id}).status());
  }
  for (const std::string& worker : change.drain) {
    RETURN_IF_ERROR(client.DrainWorker(worker).status());
  }
  Print(common, change, job);
  return kDone;
}

}  // namespace

Verb ScaleVerb() {
  return MakeVerb<ScaleOptions>(
      {.name = "scale",
       .description = "Workers on a cluster, as many as there is work for",
       .example = "scale --slurm 40 --partition compute --time 8:00:00 --server head:7443"},
      &Declare, &Scale);
}

}  // namespace calib::ctl
