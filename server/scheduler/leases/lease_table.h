#pragma once
// Who works on what, and until when: the time-limited rights to attempts. A worker is heard, and
// with it all that it works on; what it does not name all that time it knows nothing of. Pure; time
// comes with each call.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/records.h"

namespace calib::scheduler {

using Clock = std::chrono::steady_clock;

struct LeaseEntry {
  std::int64_t attempt = 0;
  store::EvaluationKey key{};
  std::string worker{};
  std::string owner{};   ///< of its campaign
  int slots = 1;         ///< that it holds, > 0
  std::string shared{};  ///< digest of what other campaigns may take from it; empty: nothing
  Clock::time_point started{};
  Clock::time_point named{};  ///< by its worker the last time, or started
};

/// Leases by attempt, by worker and by campaign, workers by when they have to be looked at: each
/// call takes O(log n) and what it returns. An attempt that is not in the table has no right to be
/// heard any more. Not thread-safe.
class LeaseTable {
 public:
  explicit LeaseTable(Clock::duration lease) : lease_(lease) {}

  /// From lease.started on; lease.named is set here. Its attempt is new.
  void Grant(LeaseEntry lease);
  /// The lease of an attempt if this worker holds it, else nullptr.
  const LeaseEntry* Find(std::int64_t attempt, const std::string& worker) const;
  /// The worker has spoken, of whatever: renews all that it holds.
  void Heard(const std::string& worker, Clock::time_point now);
  /// The worker has said that it works on it; false if it does not hold it.
  bool Named(std::int64_t attempt, const std::string& worker, Clock::time_point now);
  /// The server has stood still, to now: nothing ends before a lease time from now, in which
  /// workers can be heard.
  void Pardon(Clock::time_point now) { pardoned_ = now; }
  /// Who was not heard since then is silent.
  Clock::time_point HeardSince(Clock::time_point now) const;
  /// Takes it out; empty if there is none.
  std::optional<LeaseEntry> Release(std::int64_t attempt);
  /// Those whose worker was not heard for a lease time before `now`, nor granted them within it, in
  /// order of attempt; they are still held.
  std::vector<LeaseEntry> Expired(Clock::time_point now);
  /// Those of a worker that it has not named for four lease times.
  std::vector<LeaseEntry> Unnamed(const std::string& worker, Clock::time_point now) const;

  /// In order of attempt, as below.
  std::vector<LeaseEntry> OfWorker(const std::string& worker) const;
  std::vector<LeaseEntry> OfCampaign(std::int64_t campaign) const;
  /// Slots that a worker's leases hold.
  int Busy(const std::string& worker) const;
  /// An attempt that is held holds so many slots from now on.
  void Resize(std::int64_t attempt, int slots);

 private:
  using Attempts = std::set<std::int64_t>;
  struct Holder {
    Attempts attempts{};  ///< not empty
    int slots = 0;        ///< of these
    Clock::time_point heard{};
    Clock::time_point look_at{};  ///< nothing of it ends before
  };
  std::vector<LeaseEntry> Entries(const Attempts& attempts) const;

  Clock::duration lease_;
  std::map<std::int64_t, LeaseEntry> leases_;
  std::map<std::string, Holder> of_worker_;
  std::map<std::int64_t, Attempts> of_campaign_;               // none of them empty
  std::set<std::pair<Clock::time_point, std::string>> looks_;  // Holder::look_at of each
  Clock::time_point pardoned_ = Clock::time_point::min();
};

}  // namespace calib::scheduler
