#pragma once
// A program as a child of the worker: its pipes, its process group, its end. Linux.

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "worker/program/process_tree.h"

namespace calib::worker {

/// How the leader of the group ended: one of the two.
struct ChildEnd {
  std::optional<int> exit{};
  std::optional<int> signal{};
};

/// SIGSEGV, or `exit 1`.
std::string InWords(const ChildEnd& end);

/// Reads and writes as far as it can without waiting for the other side. Group and descendants do
/// not outlive it, nor does the child outlive the worker (PR_SET_PDEATHSIG). One thread at a time.
class ChildProcess {
 public:
  static constexpr std::size_t kMostWords = 4096;  ///< bytes of standard error that are kept

  /// Takes what comes on standard output.
  using Sink = std::function<void(std::string_view)>;

  /// Kills whatever is left.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Queues bytes for standard input; dropped once the program has closed it.
  void Send(std::string_view bytes);
  /// Input ends behind what is queued.
  void CloseInput() { close_input_ = true; }

  /// Moves what there is to move, waits `longest` at most for something to happen, and notices the
  /// end: then the output is read to its end and what is left of the group is killed.
  void Turn(std::chrono::milliseconds longest, const Sink& output);
  const std::optional<ChildEnd>& end() const { return end_; }

  /// SIGTERM to the group, `grace`, SIGKILL to the group and its descendants. Has ended after that.
  void End(std::chrono::milliseconds grace, const Sink& output);

  /// What it and its descendants use now; of one that has ended nothing.
  TreeUse Look();
  /// CPU time so far, as far as it is known: exact once it has ended, but for descendants that
  /// nobody waited for.
  double cpu_seconds() const { return cpu_seconds_; }

  /// The last bytes of standard error as UTF-8, control characters but line ends and tabs replaced.
  std::string words() const;
  void ForgetWords() { words_.clear(); }

 private:
  friend class Launcher;
  ChildProcess() = default;
  void ReadOutput(const Sink& output, std::size_t most);
  void ReadWords();
  void WriteInput();
  bool HasEnded() const;
  void KillAll();
  void Reap(const Sink& output);

  pid_t pid_ = -1;
  int input_ = -1;
  int output_ = -1;
  int error_ = -1;
  int handle_ = -1;  // pidfd; -1: the kernel has none
  std::string to_write_;
  bool close_input_ = false;
  std::string words_;
  std::vector<ProcessId> members_;  // at the last look
  double cpu_seconds_ = 0;
  std::optional<ChildEnd> end_;
};

/// Closes a file descriptor, if it is one, and forgets it (-1).
void CloseFile(int& file);

}  // namespace calib::worker
