#pragma once
// Programs that calibctl starts: calib-worker, found beside its own executable or on PATH.

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::client {

/// Path of calib-worker. NOT_FOUND with the places where it was looked for.
absl::StatusOr<std::string> FindWorkerProgram();

/// A running child. It is told to end (SIGTERM) and waited for when this object goes away. Movable.
class ChildProcess {
 public:
  /// Runs `program` with `arguments`; its output and errors are appended to log_file. In a process
  /// group of its own, so that Ctrl-C reaches calibctl alone, which then ends it in order.
  static absl::StatusOr<ChildProcess> Start(const std::string& program,
                                            const std::vector<std::string>& arguments,
                                            const std::string& log_file);
  ~ChildProcess();
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;

  /// Exit status once it has ended (128 + signal when killed); empty while it runs.
  std::optional<int> Poll();
  /// Waits for the end.
  int Wait();
  /// Sends SIGTERM, so that several children can end at the same time.
  void AskToStop();
  /// SIGTERM now, SIGKILL when it has not ended after a few seconds.
  void Stop();

 private:
  explicit ChildProcess(pid_t pid) : pid_(pid) {}
  pid_t pid_ = -1;
  std::optional<int> exit_;
};

}  // namespace calib::client
