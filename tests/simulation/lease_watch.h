#pragma once
// What has to hold of leases, as a server lists them: one a run, kept by who is heard, none for who
// drains.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "server/scheduler/scheduler.h"
#include "tests/simulation/wire.h"

namespace calib::simulation {

/// Of one server program. Not thread-safe.
class LeaseWatch {
 public:
  explicit LeaseWatch(milliseconds lease) : lease_(lease) {}

  /// The server takes in a message of this worker over this stream, or welcomes it there: a hello
  /// by itself may be refused, as that of a process whose name another bears.
  void Heard(const std::string& worker, int stream, bool is_welcomed, Time now);
  /// After each task of the strand; of_tick: it was by the clock alone. What is wrong, a sentence;
  /// empty: nothing is.
  std::string Look(scheduler::Scheduler& scheduler, Time now, bool of_tick);

 private:
  struct Leased {
    bool drains = false;
    std::multiset<std::string> runs{};
  };
  struct Voice {
    int stream = 0;  // the newest
    Time heard{};
    /// awake_ then, or when it was leased more, or when all were pardoned.
    Time::duration heard_awake{};
  };
  /// Of a tick: whose lease outlives its silence.
  std::string Outlived(Time now);
  milliseconds lease_;
  std::uint64_t seen_ = 0;  // Scheduler::workers_changed
  std::map<std::string, Leased> leased_;
  std::map<std::string, Voice> voices_;
  Time ticked_{};
  Time::duration awake_{};  // that the server has been, by its ticks
};

}  // namespace calib::simulation
