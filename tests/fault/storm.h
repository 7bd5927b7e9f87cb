#pragma once
// What goes wrong on a cluster, drawn from a seed: which faults, when, for how long.

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace calib::testing {

/// What is done to real processes.
enum class Fault {
  kServerKilled,  ///< kill -9; started again at the end
  kServerFrozen,  ///< SIGSTOP, SIGCONT
  kWorkerKilled,  ///< kill -9; another one is started at once
  kWorkerFrozen,
  kEngineKilled,  ///< a child of a worker
  kLinkCut,       ///< every connection of the workers, which may connect again at once
  kLinkSlow,      ///< messages both ways come late
  kLinkSilent,    ///< nothing comes through and nobody is told
  kDiskFull,      ///< of the server; room at the end
  kClockJumps,    ///< the server's, by an hour either way, for good
  kDamagedCopy,   ///< a server is started beside on a copy of the state with a page of noise
};

struct Blow {
  Fault fault = Fault::kServerKilled;
  std::chrono::milliseconds at{0};     ///< after the campaign was submitted
  std::chrono::milliseconds lasts{0};  ///< until it is over
  std::uint32_t chance = 0;            ///< which worker, which way, which page
};

/// Six faults of these within the first seconds of a campaign, by the time they begin; they may
/// overlap. Deterministic.
std::vector<Blow> StormOf(std::uint64_t seed, const std::vector<Fault>& faults);

/// "server_killed at 120 ms for 300 ms, ..."
std::string InWords(const std::vector<Blow>& storm);

}  // namespace calib::testing
