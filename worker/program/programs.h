#pragma once
// The programs that a worker runs in place of the mechanics: which it may run, in which folder, and
// how their runs end.

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/worker.pb.h"
#include "worker/program/fetch.h"
#include "worker/program/launcher.h"
#include "worker/program/running_program.h"
#include "worker/program/scratch.h"

namespace calib::worker {

struct ProgramsOptions {
  Fetch fetch{};                       ///< content of files
  Put put{};                           ///< of files that stay with a run; empty: they go
  std::string scratch{};               ///< root of the folders (DefaultScratchRoot)
  std::vector<std::string> allowed{};  ///< names or paths; "*": any. Empty: no program may run
  int slots = 1;                       ///< runs at a time: so many persistent programs are kept
  std::optional<std::string> path{};   ///< where names are looked for; empty: $PATH
  ProgramTimes times{};
};

/// Thread-safe. What is allowed is resolved once, at the start: names on the path (its absolute
/// entries), never in the scratch folder. Runs must have ended before it goes; persistent programs
/// end with it.
class Programs {
 public:
  explicit Programs(ProgramsOptions options);
  ~Programs();
  Programs(const Programs&) = delete;
  Programs& operator=(const Programs&) = delete;

  /// For Hello.programs: each allowed name as written and its absolute path, those that are there;
  /// "*" where any is allowed.
  std::vector<std::string> AllowedNames() const;
  /// Allowed, but not found on this machine.
  const std::set<std::string>& NotFound() const { return not_found_; }

  /// Runs a program on the calling thread; on_state gets every state as soon as it is known. Never
  /// fails: how it went is the outcome, with its reason.
  ///   COMPLETED     every load step was answered, whatever came after
  ///   DIVERGED      exit 3; NaN, infinite or null; a limit, if limit_diverges
  ///   STOPPED       stop, before the last state
  ///   MODEL_FAILED  whatever else the program does or is
  ///   FAILED        it may not run here, or its files did not come, or the disk did not take them
  /// `words`: of what diverged or failed. attempt names the run to the program and is left to the
  /// caller to set in the answer; `kept`: files that were put, or why not. report: nullptr, or what
  /// the run was like.
  v1::Finished Evaluate(const v1::ProgramRun& program, std::int64_t attempt,
                        const ProgramStateSink& on_state, std::stop_token stop,
                        ProgramReport* report = nullptr);

 private:
  struct Idle {
    std::string identity;
    std::chrono::steady_clock::time_point since;
    std::unique_ptr<RunningProgram> program;
    bool gives_way = false;  // to one that is asked for
  };
  /// A program that is to be started: an absolute path, or a file that it brings along.
  struct Executable {
    std::string path{};
    std::string brought{};
  };

  std::string Resolved(const std::string& name) const;
  absl::StatusOr<Executable> Choose(const v1::ProgramRun& program, const std::string& name) const;
  absl::StatusOr<Scratch*> OpenScratch();
  absl::StatusOr<v1::Finished> Run(const v1::ProgramRun& program, std::int64_t attempt,
                                   const ProgramStateSink& on_state, const std::stop_token& stop,
                                   ProgramReport& report);
  absl::StatusOr<std::unique_ptr<RunningProgram>> Start(const v1::ProgramRun& program,
                                                        const Executable& executable,
                                                        RunFolder folder);
  std::unique_ptr<RunningProgram> TakeIdle(const std::string& identity);
  void GiveBack(const std::string& identity, std::unique_ptr<RunningProgram> program);
  void Keep(const ProgramReport& report, const std::stop_token& stop, v1::Finished& finished) const;
  void EndUnused(const std::stop_token& stop);

  const ProgramsOptions options_;
  std::string path_;
  bool any_ = false;
  std::map<std::string, std::string> allowed_;  // name as written, and path -> path
  std::set<std::string> not_found_;

  Launcher launcher_;
  absl::Mutex mutex_;
  absl::CondVar changed_;
  std::unique_ptr<Scratch> scratch_ ABSL_GUARDED_BY(mutex_);
  int runs_ ABSL_GUARDED_BY(mutex_) = 0;          // at this moment
  std::list<Idle> idle_ ABSL_GUARDED_BY(mutex_);  // the one that was used last comes last
  std::jthread janitor_;                          // last: joined first
};

}  // namespace calib::worker
