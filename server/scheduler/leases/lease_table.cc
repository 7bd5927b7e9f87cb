#include "server/scheduler/leases/lease_table.h"

#include <algorithm>

namespace calib::scheduler {
namespace {

template <typename Predicate>
std::vector<LeaseEntry> Select(const std::map<std::int64_t, LeaseEntry>& leases,
                               Predicate predicate) {
  std::vector<LeaseEntry> selected;
  for (const auto& [attempt, entry] : leases) {
    if (predicate(entry)) {
      selected.push_back(entry);
    }
  }
  return selected;
}

}  // namespace

void LeaseTable::Grant(std::int64_t attempt, const store::EvaluationKey& key,
                       const std::string& worker, Clock::time_point now) {
  leases_[attempt] = {
      .attempt = attempt, .key = key, .worker = worker, .started = now, .expires = now + lease_};
}

const LeaseEntry* LeaseTable::Find(std::int64_t attempt, const std::string& worker) const {
  const auto it = leases_.find(attempt);
  return it != leases_.end() && it->second.worker == worker ? &it->second : nullptr;
}

bool LeaseTable::Renew(std::int64_t attempt, const std::string& worker, Clock::time_point now) {
  const auto it = leases_.find(attempt);
  if (it == leases_.end() || it->second.worker != worker) {
    return false;
  }
  it->second.expires = now + lease_;
  return true;
}

std::optional<LeaseEntry> LeaseTable::Release(std::int64_t attempt) {
  auto node = leases_.extract(attempt);
  if (node.empty()) {
    return std::nullopt;
  }
  return std::move(node.mapped());
}

std::vector<LeaseEntry> LeaseTable::TakeExpired(Clock::time_point now) {
  auto expired = Select(leases_, [now](const LeaseEntry& entry) { return entry.expires < now; });
  for (const LeaseEntry& entry : expired) {
    leases_.erase(entry.attempt);
  }
  return expired;
}

std::vector<LeaseEntry> LeaseTable::OfWorker(const std::string& worker) const {
  return Select(leases_, [&](const LeaseEntry& entry) { return entry.worker == worker; });
}

std::vector<LeaseEntry> LeaseTable::OfCampaign(std::int64_t campaign) const {
  return Select(leases_, [&](const LeaseEntry& entry) { return entry.key.campaign == campaign; });
}

int LeaseTable::Busy(const std::string& worker) const {
  return static_cast<int>(std::count_if(leases_.begin(), leases_.end(), [&](const auto& item) {
    return item.second.worker == worker;
  }));
}

}  // namespace calib::scheduler
