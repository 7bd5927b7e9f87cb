#pragma once
// Bytes from which a run goes on to the same bits: what they hold and to which run they belong.

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"

namespace calib::dem {

/// A run between two points of its path.
struct RunCheckpoint {
  std::vector<State> states{};  ///< all states that were given to the sink
  std::size_t next = 0;         ///< point of the path that comes next, > 0
  std::string procedure{};      ///< bytes of the procedure of the test, from which it can go on
};

/// The part of a checkpoint that is the same during a run: engine version and everything of the
/// scenario that determines states (not the number of threads), part by part.
std::string CheckpointHead(const Scenario& scenario);

/// A checkpoint as bytes, with a checksum at the end. head: CheckpointHead(scenario).
std::string PackCheckpoint(const std::string& head, RunCheckpoint checkpoint);

/// The checkpoint that PackCheckpoint() made into bytes. Errors: INVALID_ARGUMENT when they are no
/// checkpoint, damaged, of another engine version or of another run, naming the parts of the
/// scenario that differ.
absl::StatusOr<RunCheckpoint> UnpackCheckpoint(const Scenario& scenario, const std::string& bytes);

}  // namespace calib::dem
