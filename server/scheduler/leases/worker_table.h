#pragma once
// The workers known since the server started: who is connected, over which stream, with how many
// slots.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "calib/v1/worker.pb.h"
#include "server/scheduler/leases/lease_table.h"

namespace calib::scheduler {

struct WorkerEntry {
  v1::Hello hello{};         ///< without the attempts that it named
  std::int64_t session = 0;  ///< of its stream; 0: not connected
  bool draining = false;     ///< takes nothing new, by a user's wish
  bool leaving = false;      ///< takes nothing new, by its own; until it comes back
  Clock::time_point heard{};
};

/// Not thread-safe.
class WorkerTable {
 public:
  /// Enters a worker with its new stream; returns the session of the stream it had before, or 0. Of
  /// very many workers the one that is gone and was heard least lately is forgotten.
  std::int64_t Connect(const v1::Hello& hello, std::int64_t session, Clock::time_point now);
  /// Whether another process is connected under this name, was heard since then and has not said
  /// that it leaves.
  bool IsAnother(const v1::Hello& hello, Clock::time_point heard_since) const;
  void Disconnect(std::int64_t session);
  /// Forgets those that are gone and were not heard since then.
  void ForgetGone(Clock::time_point heard_since);

  WorkerEntry* Find(const std::string& name);
  /// By its stream, or nullptr when that has been replaced.
  WorkerEntry* OfSession(std::int64_t session);
  /// Workers with free slots, the most first (ties: by name), among those that are connected, not
  /// draining and were heard since `heard_since` (a frozen machine keeps its connection).
  std::vector<const WorkerEntry*> Free(const LeaseTable& leases,
                                       Clock::time_point heard_since) const;
  /// Whether a worker with this checkpoint folder is there and takes work, be it busy now.
  bool IsThere(const std::string& checkpoints, Clock::time_point heard_since) const;
  const std::map<std::string, WorkerEntry>& all() const { return workers_; }
  int Slots() const;  ///< of all that are connected

 private:
  void ForgetOldest();

  std::map<std::string, WorkerEntry> workers_;
};

}  // namespace calib::scheduler
