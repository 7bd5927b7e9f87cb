#include "server/scheduler/leases/lease_table.h"

#include <algorithm>

namespace calib::scheduler {
namespace {

/// Lease times in which a worker names what it works on. chosen: what lies in the queues of a
/// server that is late by a lease time in both directions has come and gone by then
constexpr int kUnnamedLeases = 4;

}  // namespace

void LeaseTable::Grant(LeaseEntry lease) {
  lease.named = lease.started;
  const auto [holder, is_new] = of_worker_.try_emplace(lease.worker);
  holder->second.attempts.insert(lease.attempt);
  holder->second.slots += lease.slots;
  if (is_new) {
    holder->second.heard = lease.started;
    holder->second.look_at = lease.started + lease_;
    looks_.emplace(holder->second.look_at, lease.worker);
  }
  of_campaign_[lease.key.campaign].insert(lease.attempt);
  leases_.emplace(lease.attempt, std::move(lease));
}

const LeaseEntry* LeaseTable::Find(std::int64_t attempt, const std::string& worker) const {
  const auto it = leases_.find(attempt);
  return it != leases_.end() && it->second.worker == worker ? &it->second : nullptr;
}

void LeaseTable::Heard(const std::string& worker, Clock::time_point now) {
  if (const auto holder = of_worker_.find(worker); holder != of_worker_.end()) {
    holder->second.heard = now;
  }
}

bool LeaseTable::Named(std::int64_t attempt, const std::string& worker, Clock::time_point now) {
  const auto it = leases_.find(attempt);
  if (it == leases_.end() || it->second.worker != worker) {
    return false;
  }
  it->second.named = now;
  return true;
}

Clock::time_point LeaseTable::HeardSince(Clock::time_point now) const {
  return now - lease_ < pardoned_ ? Clock::time_point::min() : now - lease_;
}

std::optional<LeaseEntry> LeaseTable::Release(std::int64_t attempt) {
  auto node = leases_.extract(attempt);
  if (node.empty()) {
    return std::nullopt;
  }
  LeaseEntry lease = std::move(node.mapped());
  const auto holder = of_worker_.find(lease.worker);
  holder->second.attempts.erase(attempt);
  holder->second.slots -= lease.slots;
  if (holder->second.attempts.empty()) {
    looks_.erase({holder->second.look_at, lease.worker});
    of_worker_.erase(holder);
  }
  const auto campaign = of_campaign_.find(lease.key.campaign);
  campaign->second.erase(attempt);
  if (campaign->second.empty()) {
    of_campaign_.erase(campaign);
  }
  return lease;
}

std::vector<LeaseEntry> LeaseTable::Expired(Clock::time_point now) {
  Attempts expired;
  std::vector<decltype(looks_)::value_type> next;
  while (!looks_.empty() && looks_.begin()->first < now) {
    const std::string worker = looks_.begin()->second;
    looks_.erase(looks_.begin());
    Holder& holder = of_worker_.at(worker);
    holder.look_at = Clock::time_point::max();
    for (const std::int64_t attempt : holder.attempts) {
      const Clock::time_point end =
          std::max({holder.heard, leases_.at(attempt).started, pardoned_}) + lease_;
      holder.look_at = std::min(holder.look_at, end);
      if (end < now) {
        expired.insert(attempt);
      }
    }
    next.emplace_back(holder.look_at, worker);
  }
  looks_.insert(next.begin(), next.end());
  return Entries(expired);
}

std::vector<LeaseEntry> LeaseTable::Unnamed(const std::string& worker,
                                            Clock::time_point now) const {
  std::vector<LeaseEntry> unnamed;
  const auto holder = of_worker_.find(worker);
  if (holder == of_worker_.end()) {
    return unnamed;
  }
  for (const std::int64_t attempt : holder->second.attempts) {
    const LeaseEntry& lease = leases_.at(attempt);
    if (std::max(lease.named, pardoned_) + kUnnamedLeases * lease_ < now) {
      unnamed.push_back(lease);
    }
  }
  return unnamed;
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
  return found == of_worker_.end() ? std::vector<LeaseEntry>{} : Entries(found->second.attempts);
}

std::vector<LeaseEntry> LeaseTable::OfCampaign(std::int64_t campaign) const {
  const auto found = of_campaign_.find(campaign);
  return found == of_campaign_.end() ? std::vector<LeaseEntry>{} : Entries(found->second);
}

int LeaseTable::Busy(const std::string& worker) const {
  const auto found = of_worker_.find(worker);
  return found == of_worker_.end() ? 0 : found->second.slots;
}

void LeaseTable::Resize(std::int64_t attempt, int slots) {
  LeaseEntry& lease = leases_.at(attempt);
  of_worker_.at(lease.worker).slots += slots - lease.slots;
  lease.slots = slots;
}

}  // namespace calib::scheduler
