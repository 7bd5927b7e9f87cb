#pragma once
// The engines of a worker: the mechanics of this tree, each in a process of its own, so that a run
// that dies takes nothing along.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/worker.pb.h"
#include "worker/engine/frames.h"
#include "worker/program/child_process.h"
#include "worker/program/fetch.h"
#include "worker/program/launcher.h"
#include "worker/program/scratch.h"

namespace calib::worker {

struct EnginesOptions {
  /// The program that answers to `--engine` (calib-worker); by default this very one.
  std::string program = "/proc/self/exe";
  Fetch fetch{};              ///< content of packings and meshes
  std::string scratch{};      ///< root of the folder that engines share (DefaultScratchRoot)
  std::string checkpoints{};  ///< folder for runs that rest; empty: none are kept
  std::int64_t most_checkpoint_bytes = std::int64_t{4} << 30;
  std::chrono::milliseconds grace{10'000};  ///< from a stop to SIGKILL
};

/// Thread-safe. As many processes as there are runs at a time, started when they are needed and
/// kept until this goes; runs must have ended before.
class Engines {
 public:
  explicit Engines(EnginesOptions options);
  ~Engines();
  Engines(const Engines&) = delete;
  Engines& operator=(const Engines&) = delete;

  /// Runs the spec of a lease on the calling thread; on_state gets every state as soon as it is
  /// reached. Never fails: what went wrong is the outcome, with its reason.
  ///   those of Evaluate() and EvaluateToRung(), and
  ///   MODEL_FAILED  the process ended, with its signal, or came to one of the lease's limits, and
  ///                 was killed; `words`: the last that it printed
  ///   STOPPED       told to by `stop` or `leave`, even where it has to be killed for it
  ///   FAILED        this machine starts no process
  /// `leave`: a run that the lease gives a name to leaves a checkpoint, from which it goes on
  /// elsewhere. finished.attempt is left to the caller.
  v1::Finished Evaluate(const v1::Lease& lease, const std::function<void(v1::State)>& on_state,
                        const std::stop_token& stop, const std::stop_token& leave = {});

 private:
  class Talk;
  struct Engine {
    std::unique_ptr<ChildProcess> process;
    FrameReader reader{};  // of all runs: a specimen may be asked for while none is under way
  };

  /// One that waits, where it has left a run of such limits its memory.
  absl::StatusOr<Engine> Take(const v1::ProgramLimits& limits);
  absl::StatusOr<Engine> Start();
  void GiveBack(Engine engine);

  const EnginesOptions options_;
  Launcher launcher_;
  absl::Mutex mutex_;
  std::unique_ptr<Scratch> scratch_ ABSL_GUARDED_BY(mutex_);
  RunFolder shared_ ABSL_GUARDED_BY(mutex_);
  std::vector<Engine> idle_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace calib::worker
