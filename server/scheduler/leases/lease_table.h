#pragma once
// Who works on what, and until when: the time-limited rights to attempts. Pure; time comes with
// each call.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/store/records.h"

namespace calib::scheduler {

using Clock = std::chrono::steady_clock;

struct LeaseEntry {
  std::int64_t attempt = 0;
  store::EvaluationKey key{};
  std::string worker{};
  Clock::time_point started{};
  Clock::time_point expires{};
};

/// Leases by attempt. An attempt that is not in the table has no right to be heard any more. Not
/// thread-safe.
class LeaseTable {
 public:
  explicit LeaseTable(Clock::duration lease) : lease_(lease) {}

  void Grant(std::int64_t attempt, const store::EvaluationKey& key, const std::string& worker,
             Clock::time_point now);
  /// The lease of an attempt if this worker holds it, else nullptr.
  const LeaseEntry* Find(std::int64_t attempt, const std::string& worker) const;
  /// Extends it; false if this worker does not hold it.
  bool Renew(std::int64_t attempt, const std::string& worker, Clock::time_point now);
  /// Takes it out; empty if there is none.
  std::optional<LeaseEntry> Release(std::int64_t attempt);
  /// Takes out those that ended before `now`, in order of attempt.
  std::vector<LeaseEntry> TakeExpired(Clock::time_point now);

  std::vector<LeaseEntry> OfWorker(const std::string& worker) const;
  std::vector<LeaseEntry> OfCampaign(std::int64_t campaign) const;
  int Busy(const std::string& worker) const;

 private:
  Clock::duration lease_;
  std::map<std::int64_t, LeaseEntry> leases_;
};

}  // namespace calib::scheduler
