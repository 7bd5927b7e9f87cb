#pragma once
// The workers known since the server started: who is connected, over which stream, with how many
// slots, and which of them takes the next run.

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/v1/worker.pb.h"
#include "server/scheduler/leases/lease_table.h"

namespace calib::scheduler {

struct WorkerEntry {
  v1::Hello hello{};                              ///< without the attempts that it named
  std::int64_t session = 0;                       ///< of its stream; 0: not connected
  int busy = 0;                                   ///< slots with a lease
  bool draining = false;                          ///< takes nothing new, by a user's wish
  std::optional<Clock::time_point> drained_by{};  ///< and leaves what then runs; empty: it ends
  bool leaving = false;  ///< takes nothing new, by its own; until it comes back
  bool silent = false;   ///< takes nothing new until it is heard
  Clock::time_point heard{};
};

/// Indexed by name, by stream, and by free slots: a call takes O(log n) unless it says more. Not
/// thread-safe.
class WorkerTable {
 public:
  /// What decides on which runs a worker may take.
  struct Kind {
    std::vector<std::string> programs{};  ///< Hello::programs
    int slots = 0;
    int threads = 1;           ///< of all slots
    double memory = 0;         ///< of all slots [bytes]; 0: not told
    std::string mechanics{};   ///< version and catalogue of its DEM
    bool limits_runs = false;  ///< kLimitsRuns (proto/calib/v1/protocol.h)
    // NOLINTNEXTLINE(modernize-use-nullptr): takes the 0 behind it for a pointer
    friend auto operator<=>(const Kind&, const Kind&) = default;
  };
  static Kind KindOf(const v1::Hello& hello);
  /// Of a DEM, to be compared: others give other bits.
  static std::string Mechanics(const std::string& version, const std::string& catalog_digest);
  /// Slots that a run would hold of such a worker, > 0; 0: it may not have it.
  using Needs = std::function<int(const Kind&)>;
  /// Who is passed over, by name.
  using Others = std::set<std::string>;

  WorkerTable() = default;
  WorkerTable(const WorkerTable&) = delete;  // the indices point into it
  WorkerTable& operator=(const WorkerTable&) = delete;

  /// Enters a worker with its new stream and this many leases; returns the session of the stream it
  /// had before, or 0. Of very many workers the one that is gone and was heard least lately is
  /// forgotten.
  std::int64_t Connect(const v1::Hello& hello, std::int64_t session, int busy,
                       Clock::time_point now);
  /// Whether another process is connected under this name, was heard since then and has not said
  /// that it leaves.
  bool IsAnother(const v1::Hello& hello, Clock::time_point heard_since) const;
  void Disconnect(std::int64_t session);
  /// Its leases are so many now. Without effect on one that is not known, as below.
  void SetBusy(const std::string& name, int leases);
  /// by: when it leaves what it still runs; empty: that ends first.
  void Drain(const std::string& name, std::optional<Clock::time_point> by = {});
  void Leave(std::int64_t session);
  /// The worker that has spoken over this stream, or nullptr when that has been replaced.
  /// was_silent is set where it took nothing for its silence, and is left alone otherwise.
  const WorkerEntry* Heard(std::int64_t session, Clock::time_point now, bool* was_silent);
  /// Those that were not heard since then are silent (a frozen machine keeps its connection);
  /// those that are gone and were not heard since `remembered_since` are forgotten. O(n).
  void Review(Clock::time_point heard_since, Clock::time_point remembered_since);

  const WorkerEntry* Find(const std::string& name) const;
  /// By its stream, or nullptr when that has been replaced.
  const WorkerEntry* OfSession(std::int64_t session) const;
  /// Whether any worker has a free slot and takes work.
  bool AnyFree() const { return free_slots_ > 0; }
  struct Choice {
    const WorkerEntry* worker = nullptr;  ///< nullptr: none
    int slots = 0;                        ///< that the run would hold
    int missing = 0;                      ///< of these, of which its runs have to leave first
  };
  /// The worker with the most free slots (ties: by name) among those that take work and may have
  /// such a run now; where there is none, the one of which fewest are missing. O(n) in the kinds
  /// that differ and in the others.
  Choice Freest(const Needs& needs, const Others& without = {}) const;
  /// The same among those with this checkpoint folder that have a free slot. O(n) in these.
  Choice FreestAt(const std::string& checkpoints, const Needs& needs,
                  const Others& without = {}) const;
  /// Whether a worker with this checkpoint folder takes work, be it busy now.
  bool IsThere(const std::string& checkpoints) const { return there_.count(checkpoints) > 0; }
  const std::map<std::string, WorkerEntry>& all() const { return workers_; }
  int Slots() const { return slots_; }  ///< of all that are connected

 private:
  struct Freer {
    bool operator()(const WorkerEntry* a, const WorkerEntry* b) const;
  };
  using Ranking = std::set<const WorkerEntry*, Freer>;
  struct Folder {
    int workers = 0;  ///< that take work
    Ranking free{};
  };
  void Index(const WorkerEntry& entry);
  void Unindex(const WorkerEntry& entry);
  /// Whatever an index is made of changes here only.
  template <typename F>
  void Change(WorkerEntry& entry, F change) {
    Unindex(entry);
    change(entry);
    Index(entry);
  }
  void ForgetOldest();

  std::map<std::string, WorkerEntry> workers_;
  std::map<std::int64_t, WorkerEntry*> by_session_;
  std::map<Kind, Ranking> kinds_;        // that take work; no ranking is empty
  std::map<std::string, Folder> there_;  // by checkpoint folder; in each at least one takes work
  int slots_ = 0;
  int free_slots_ = 0;  // of those that take work
};

}  // namespace calib::scheduler
