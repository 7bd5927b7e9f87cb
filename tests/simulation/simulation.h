#pragma once
// One service: a server program on its disk, workers, the wire between them, people. Which of all
// that may go on does so next is thrown by dice, and so is what goes wrong.

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/simulation/campaigns.h"
#include "tests/simulation/crash_file_system.h"
#include "tests/simulation/dice.h"
#include "tests/simulation/ledger.h"
#include "tests/simulation/server_process.h"
#include "tests/simulation/worker_process.h"

namespace calib::simulation {

struct SimulationOptions {
  std::uint64_t seed = 1;
  std::string fault{};      ///< planted, by name (faults.h); empty: none
  int campaign = -1;        ///< this one alone and nothing goes wrong; < 0: what the seed says
  bool traces_all = false;  ///< every event to standard output
};

struct SimulationResult {
  std::string violation{};          ///< empty: everything held
  std::vector<std::string> last{};  ///< events, the last hundred
  std::uint64_t digest = 0;         ///< of all events
  std::int64_t events = 0;
  int restarts = 0;           ///< of the server
  double seconds = 0;         ///< simulated
  double calm_seconds = 0;    ///< since nothing went wrong any more
  std::string fingerprint{};  ///< of campaign 1, where it is alone
};

/// The same options give the same events. Not to be run twice at a time in a process.
SimulationResult Simulate(const SimulationOptions& options);

}  // namespace calib::simulation
