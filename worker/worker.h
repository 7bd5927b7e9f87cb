#pragma once
// The daemon on a compute node: keeps its link to the server, runs what is leased to it, sends what
// comes out.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "proto/rpc/access.h"

namespace calib::worker {

struct WorkerOptions {
  std::string server{};                   ///< HOST:PORT or unix:/PATH
  rpc::AccessChoice access{};             ///< what is shown there
  std::string name{};                     ///< unique among the server's workers
  int slots = 1;                          ///< attempts at a time, > 0
  int threads_per_slot = 1;               ///< > 0
  int threads = 0;                        ///< that all runs may use; 0: those of the slots
  double memory = 0;                      ///< that all runs may have [bytes]; 0: nobody knows
  std::string user{};                     ///< account that it runs as
  double contact_updates_per_second = 0;  ///< speed of one thread, as measured
  std::string cpu{};                      ///< model name, recorded with every attempt
  std::string checkpoints{};  ///< absolute folder for runs that rest; empty: none are kept
  std::int64_t most_checkpoint_bytes = std::int64_t{4} << 30;
  std::vector<std::string> allowed_commands{};  ///< programs that may run as models; "*": any
  std::string scratch{};  ///< folder below which they run and engines share; empty: the usual
  std::string engine = "/proc/self/exe";  ///< the program that answers to `--engine`
  std::chrono::seconds drain_within{0};   ///< after a first signal, for what runs to end
  std::chrono::milliseconds farewell{
      3000};  ///< longest wait for the last acknowledgement after a stop
};

/// Runs until SIGTERM or SIGINT (simulations are stopped, what they have computed is sent; with
/// drain_within they may end first, unless a second signal comes), until the server has drained it,
/// or until the server refuses it. A lost connection is opened again with growing, jittered waits.
/// Run() is called once; nothing here is thread-safe.
class Worker {
 public:
  explicit Worker(WorkerOptions options);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// OK after a stop or drain; otherwise why the server refused this worker, or what is wrong with
  /// what it is to show there.
  absl::Status Run();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::worker
