#pragma once
// Workers as jobs of Slurm: the batch script of an array of them, what the queue holds, and what
// makes them as many as there is work for. Pure.

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"

namespace calib::ctl {

/// What each worker of an array is started with.
struct WorkerArray {
  std::string server{};     ///< HOST:PORT
  std::string program{};    ///< calib-worker, a path on the nodes
  std::string partition{};  ///< empty: the cluster's
  std::string time{};       ///< limit, as Slurm writes it; empty: the partition's
  std::string tls{};        ///< folder of a worker's certificate; empty: none
  std::string token{};      ///< file; empty: where a worker looks
  int cpus = 1;             ///< of a worker, which has as many slots
};

/// INVALID_ARGUMENT, a line each: an address that other nodes cannot know, a partition or a time
/// that is none.
absl::Status CheckArray(const WorkerArray& array);

/// The name that all jobs for this server have, by which they are known again.
std::string JobNameOf(const WorkerArray& array);

/// The batch script of `count` > 0 workers. Each is the process of its job itself, is told a minute
/// before the time is over, and then, as when its job is cancelled, ends what it can in the half
/// minute that Slurm leaves it.
std::string BatchScript(const WorkerArray& array, int count);

struct SlurmJob {
  std::string id{};      ///< of the array and the task, as 17_3
  bool pending = false;  ///< it has not begun
};

/// The arguments of squeue, and the jobs of its answer, but those that are ending. INTERNAL: a line
/// that is none.
std::vector<std::string> QueueCommand(const WorkerArray& array);
absl::StatusOr<std::vector<SlurmJob>> JobsOf(const std::string& answer);

/// The name of a job's worker.
std::string WorkerOf(const SlurmJob& job);

/// Samples that are to be run before the campaigns that run can go on: at least one of each.
int OpenSamples(const std::vector<v1::CampaignStatus>& campaigns);

struct Change {
  int wanted = 0;  ///< workers, for what is open
  int there = 0;   ///< jobs that pend or run and whose workers are not draining
  int start = 0;
  std::vector<std::string> cancel{};  ///< jobs that have not begun
  std::vector<std::string> drain{};   ///< workers
};

struct Demand {
  int most = 0;  ///< workers, >= 0
  int open = 0;  ///< samples
  int cpus = 1;  ///< of a worker
};

/// What makes the workers as many as there is work for, `most` at most. What has not begun goes
/// first; a worker that computes is drained only where there are more than `most`.
Change ChangeFor(const Demand& demand, const std::vector<SlurmJob>& jobs,
                 const std::vector<v1::WorkerInfo>& workers);

}  // namespace calib::ctl
