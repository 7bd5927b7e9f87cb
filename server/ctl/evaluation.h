#pragma once
// One model evaluation by a calib-worker without a server.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"
#include "server/client/child_process.h"

namespace calib::ctl {

/// Runs `calib-worker --once`, or --once-program, in a folder of its own. Movable.
class Evaluation {
 public:
  struct Task {
    v1::AttemptSpec spec;
    std::string packing;              ///< text of the packing file; empty with a recipe
    std::vector<std::string> meshes;  ///< contents of the STL files
    std::string vtk;                  ///< folder for grains; empty: none
    std::optional<int> load_step;     ///< it ends there and draws no other; empty: all
    std::string checkpoint;           ///< file to go on from and to renew; empty: none
    /// In place of all that: a run of a program, and its files by digest.
    std::optional<v1::ProgramRun> program = {};
    std::map<std::string, std::string> files = {};
  };
  /// folder: an existing folder for the files in between.
  static absl::StatusOr<Evaluation> Start(const std::string& program, const Task& task,
                                          const std::string& folder);

  /// True once the worker has ended.
  bool Poll() { return process_.Poll().has_value(); }
  /// States so far: whole lines of its table.
  int StatesSoFar() const;
  /// The table of states, `load_step,<observables>`; complete or not.
  std::string Table() const;
  /// Of a program's run, what it was like (JSON of calib-worker --report); empty before its end.
  std::string Report() const;
  /// OK; ABORTED with the reason when the model diverged; INVALID_ARGUMENT when the checkpoint is
  /// not of this run; INTERNAL otherwise. Only after Poll() has said true.
  absl::Status Result();

 private:
  static absl::StatusOr<Evaluation> StartProgram(const std::string& program, const Task& task,
                                                 const std::string& folder);
  Evaluation(client::ChildProcess process, std::string folder)
      : process_(std::move(process)), folder_(std::move(folder)) {}
  client::ChildProcess process_;
  std::string folder_;
};

}  // namespace calib::ctl
