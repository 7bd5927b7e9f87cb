#pragma once
// One run of a user's program without a server: the dry run.

#include <iosfwd>
#include <string>

namespace calib::worker {

struct ProgramOnceOptions {
  std::string run{};      ///< file with a ProgramRun, JSON or binary protobuf
  std::string files{};    ///< folder that holds its files, each under its digest
  std::string output{};   ///< CSV file; empty: standard output
  std::string report{};   ///< file for what the run was like, JSON; empty: none
  std::string scratch{};  ///< as WorkerOptions::scratch
};

/// Writes `load_step,<observables>` and a row per state as soon as it is known (17 significant
/// digits), and at the end the report: request, ignored_lines, ignored, wall_seconds, core_seconds,
/// peak_memory, all_at_once, words, kept, not_kept. Any program may run: whoever calls this says
/// which. Returns an exit code of once.h.
int RunProgramOnce(const ProgramOnceOptions& options, std::ostream& errors);

}  // namespace calib::worker
