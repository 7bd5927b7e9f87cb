#pragma once
// Who works on what, and until when: the time-limited rights to attempts. Pure; time comes with
// each call.

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
  std::string shared{};  ///< digest of what other campaigns may take from it; empty: nothing
  Clock::time_point started{};
  Clock::time_point expires{};
};

/// Leases by attempt, by worker, by campaign and by their ends: each call takes O(log n) and what
/// it returns. An attempt that is not in the table has no right to be heard any more. Not
/// thread-safe.
class LeaseTable {
 public:
  explicit LeaseTable(Clock::duration lease) : lease_(lease) {}

  /// From now on; lease.expires is set here. Its attempt is new.
  void Grant(LeaseEntry lease);
  /// The lease of an attempt if this worker holds it, else nullptr.
  const LeaseEntry* Find(std::int64_t attempt, const std::string& worker) const;
  /// Extends it; false if this worker does not hold it.
  bool Renew(std::int64_t attempt, const std::string& worker, Clock::time_point now);
  /// Takes it out; empty if there is none.
  std::optional<LeaseEntry> Release(std::int64_t attempt);
  /// Those that ended before `now`, in order of attempt; they are still held.
  std::vector<LeaseEntry> Expired(Clock::time_point now) const;

  /// In order of attempt, as below.
  std::vector<LeaseEntry> OfWorker(const std::string& worker) const;
  std::vector<LeaseEntry> OfCampaign(std::int64_t campaign) const;
  int Busy(const std::string& worker) const;

 private:
  using Attempts = std::set<std::int64_t>;
  std::vector<LeaseEntry> Entries(const Attempts& attempts) const;

  Clock::duration lease_;
  std::map<std::int64_t, LeaseEntry> leases_;
  std::map<std::string, Attempts> of_worker_;     // none of them empty
  std::map<std::int64_t, Attempts> of_campaign_;  // none of them empty
  std::set<std::pair<Clock::time_point, std::int64_t>> ends_;
};

}  // namespace calib::scheduler
