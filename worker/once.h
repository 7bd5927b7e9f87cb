#pragma once
// One model evaluation without a server.

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace calib::worker {

struct OnceOptions {
  std::string spec{};  ///< file with an AttemptSpec, JSON or binary protobuf
  /// File whose text has the spec's packing_digest, or its recipe's sizes_digest; empty: the spec
  /// names none.
  std::string packing{};
  std::vector<std::string> meshes{};  ///< files that have the digests of the spec's meshes
  std::string output{};               ///< CSV file; empty: standard output
  std::string vtk{};                  ///< folder for grains; empty: none
  std::optional<int> load_step{};     ///< the run ends there and draws no other; empty: all
  /// File that is replaced after each load step by what the run goes on from; when it is there, the
  /// run begins behind it. Empty: none.
  std::string checkpoint{};
};

inline constexpr int kCompleted = 0;      ///< exit code: all load steps, or load_step, were reached
inline constexpr int kModelDiverged = 1;  ///< exit code: the model cannot do it
inline constexpr int kBadSpec = 2;        ///< exit code: the spec is unusable, or the run failed
inline constexpr int kRefusedCheckpoint = 3;  ///< exit code: the checkpoint is of another run

/// Writes `load_step,<observables>` and a row per state as soon as it is reached (17 significant
/// digits), of a resumed run all rows, messages to `errors`. Returns one of the exit codes above.
int RunOnce(const OnceOptions& options, std::ostream& errors);

}  // namespace calib::worker
