#include "server/scheduler/leases/lease_table.h"

namespace calib::scheduler {
namespace {

template <typename Map, typename Key>
void Take(Map& map, const Key& key, std::int64_t attempt) {
  const auto found = map.find(key);
  found->second.erase(attempt);
  if (found->second.empty()) {
    map.erase(found);
  }
}

}  // namespace

void LeaseTable::Grant(LeaseEntry lease) {
  lease.expires = lease.started + lease_;
  of_worker_[lease.worker].insert(lease.attempt);
  of_campaign_[lease.key.campaign].insert(lease.attempt);
  ends_.emplace(lease.expires, lease.attempt);
  leases_.emplace(lease.attempt, std::move(lease));
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
  ends_.erase({it->second.expires, attempt});
  it->second.expires = now + lease_;
  ends_.emplace(it->second.expires, attempt);
  return true;
}

std::optional<LeaseEntry> LeaseTable::Release(std::int64_t attempt) {
  auto node = leases_.extract(attempt);
  if (node.empty()) {
    return std::nullopt;
  }
  LeaseEntry lease = std::move(node.mapped());
  Take(of_worker_, lease.worker, attempt);
  Take(of_campaign_, lease.key.campaign, attempt);
  ends_.erase({lease.expires, attempt});
  return lease;
}

std::vector<LeaseEntry> LeaseTable::Expired(Clock::time_point now) const {
  Attempts expired;
  for (auto end = ends_.begin(); end != ends_.end() && end->first < now; ++end) {
    expired.insert(end->second);
  }
  return Entries(expired);
}

std::vector<LeaseEntry> LeaseTable::Entries(const Attempts& attempts) const {
  std::vector<LeaseEntry> entries;
  entries.reserve(attempts.size());
  for (const std::int64_t attempt : attempts) {
    entries.push_back(leases_.at(attempt));
  }
  return entries;
}

std::vector<LeaseEntry> LeaseTable::OfWorker(const std::string& worker) const {
  const auto found = of_worker_.find(worker);
  return found == of_worker_.end() ? std::vector<LeaseEntry>{} : Entries(found->second);
}

std::vector<LeaseEntry> LeaseTable::OfCampaign(std::int64_t campaign) const {
  const auto found = of_campaign_.find(campaign);
  return found == of_campaign_.end() ? std::vector<LeaseEntry>{} : Entries(found->second);
}

int LeaseTable::Busy(const std::string& worker) const {
  const auto found = of_worker_.find(worker);
  return found == of_worker_.end() ? 0 : static_cast<int>(found->second.size());
}

}  // namespace calib::scheduler
