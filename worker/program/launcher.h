#pragma once
// How a program becomes a child of the worker: pipes, fork and exec. Linux.

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/program/child_process.h"

namespace calib::worker {

struct ChildOptions {
  std::string program{};                    ///< absolute path
  std::vector<std::string> arguments{};     ///< the first is the name of the program, as written
  std::string folder{};                     ///< its working directory
  std::vector<std::string> environment{};   ///< NAME=VALUE, in place of what the worker has
  std::optional<double> most_file_bytes{};  ///< that one file may have (RLIMIT_FSIZE)
};

/// Starts children from a thread of its own that lives as long as it does: PR_SET_PDEATHSIG fires
/// when the thread ends that made the child, and a child may be used from several. Thread-safe.
class Launcher {
 public:
  Launcher();
  /// Its children must have ended.
  ~Launcher();
  Launcher(const Launcher&) = delete;
  Launcher& operator=(const Launcher&) = delete;

  /// A child that runs the program: own process group, no core files, no other open file of the
  /// worker, signals as at the start of a program. FAILED_PRECONDITION: the program cannot be run,
  /// with why; UNAVAILABLE: this machine has no process, pipe or memory left.
  absl::StatusOr<std::unique_ptr<ChildProcess>> Start(const ChildOptions& options);

 private:
  void Serve(const std::stop_token& stop);
  absl::StatusOr<std::unique_ptr<ChildProcess>> StartOnce(const ChildOptions& options);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<std::function<void()>> orders_;
  std::jthread thread_;  // last: joined first
};

}  // namespace calib::worker
