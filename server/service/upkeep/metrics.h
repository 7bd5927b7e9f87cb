#pragma once
// What a server counts and measures, in the text format of Prometheus (0.0.4).

#include <chrono>
#include <cstddef>
#include <map>
#include <string>

#include "server/store/numbers.h"

namespace calib::service {

/// All of it at one moment.
struct Measured {
  std::string engine{};
  double seconds = 0;  ///< since the server started
  bool store_waits = false;

  // ---- of the scheduler ----
  std::size_t campaigns = 0;          ///< that are not over
  std::size_t being_read = 0;         ///< of those, at the start: workers are let in when none is
  std::size_t queued = 0;             ///< evaluations that wait for a slot
  std::size_t planning = 0;           ///< campaigns whose next iteration is being computed
  int workers = 0;                    ///< connected
  int draining = 0;                   ///< of those
  int silent = 0;                     ///< neither connected nor left
  int slots = 0;                      ///< of connected workers
  int busy = 0;                       ///< of those
  std::map<std::string, int> held{};  ///< slots by the owner of the runs

  store::StoreNumbers store{};
  store::Durations::Counts acknowledgements{};  ///< from a write to its answer
  store::Durations::Counts strand_lag{};        ///< from a task to its begin
};

/// Pure. Names and units as Prometheus wants them: seconds, bytes, _total of what only grows.
std::string MetricsText(const Measured& measured);

}  // namespace calib::service
