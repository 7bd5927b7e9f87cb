#pragma once
// A program that runs, and the talk with it about one run: request, states, limits, end.

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/v1/common.pb.h"
#include "calib/v1/worker.pb.h"
#include "worker/program/answer_reader.h"
#include "worker/program/child_process.h"
#include "worker/program/run_files.h"
#include "worker/program/scratch.h"

namespace calib::worker {

/// How long what is waited for; tests shorten them.
struct ProgramTimes {
  std::chrono::milliseconds to_end{60'000};        ///< from the last state to the program's own end
  std::chrono::milliseconds grace{10'000};         ///< from SIGTERM, or a stop, to SIGKILL
  std::chrono::milliseconds between_looks{50};     ///< at memory and the table
  std::chrono::milliseconds between_walks{1000};   ///< through the scratch folder, at least
  std::chrono::milliseconds longest_idle{60'000};  ///< of a persistent program without a run
};

/// What a run was like, for the dry run and for files that stay with it.
struct ProgramReport {
  std::string request{};                   ///< the line, without its end
  std::int64_t ignored_lines = 0;          ///< of standard output, that were no answer
  std::vector<std::string> ignored{};      ///< the first of them, cut to 200 bytes
  double wall_seconds = 0;                 ///< from the request to the end
  double peak_memory = 0;                  ///< bytes, resident, of the program and its descendants
  bool all_at_once = false;                ///< more than 3 states, all in the last 5 % of the time
  std::string words{};                     ///< the last 4 KiB of standard error
  std::vector<std::string> checkpoints{};  ///< files that were named
  std::vector<KeptContent> kept{};         ///< of a run that completed or diverged
  std::map<std::string, std::string> not_kept{};  ///< why not, by name of a file of `keep`
};

using ProgramStateSink = std::function<void(v1::State)>;

/// A child in its folder. One thread at a time.
class RunningProgram {
 public:
  RunningProgram(std::unique_ptr<ChildProcess> child, RunFolder folder, ProgramTimes times)
      : folder_(std::move(folder)), child_(std::move(child)), times_(times) {}
  /// Kills it if it has not ended; End() is more polite.
  ~RunningProgram() = default;
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  /// Sends the request and listens until the run is over; on_state gets every state as soon as it
  /// is known. Files stand in the folder. Never fails: what went wrong is the outcome, with its
  /// reason. Afterwards the program has ended, or, if `persistent`, waits for the next request.
  v1::Finished Run(const v1::ProgramRun& program, const std::string& run,
                   const std::string& request, const ProgramStateSink& on_state,
                   const std::stop_token& stop, ProgramReport& report);

  /// Whether it can be asked again. Passes over what it has said meanwhile.
  bool IsWaiting();
  /// Input ends, SIGTERM, grace, SIGKILL.
  void End();

  const std::string& folder() const { return folder_.path(); }

 private:
  class Talk;

  RunFolder folder_;  // first: it goes after the child
  std::unique_ptr<ChildProcess> child_;
  ProgramTimes times_;
  AnswerReader reader_;  // of all runs: a line may begin in one and end in the next
  bool in_step_ = true;  // nothing of an earlier run is still to come
};

}  // namespace calib::worker
