#pragma once
// A process and its descendants, by /proc.

#include <sys/types.h>

#include <cstdint>
#include <vector>

namespace calib::worker {

/// A process; its id alone may have gone to another since.
struct ProcessId {
  pid_t pid = 0;
  std::uint64_t started = 0;  ///< clock ticks since boot
  friend bool operator==(const ProcessId&, const ProcessId&) = default;
};

struct TreeUse {
  double resident_bytes = 0;  ///< pages that are shared count in each process
  double cpu_seconds = 0;     ///< user and system, of ended children that were waited for as well
  std::vector<ProcessId> members{};
};

/// Looks at root and whoever descends from it now. A child whose parent has ended is nobody's
/// descendant; what ends meanwhile is left out. Never fails. Thread-safe.
TreeUse LookAtTree(pid_t root);

/// Whether it has not ended, or nobody has waited for it.
bool IsThere(const ProcessId& process);

/// SIGKILL to a process that is still the same one.
void KillIfThere(const ProcessId& process);

}  // namespace calib::worker
