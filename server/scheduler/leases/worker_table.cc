#include "server/scheduler/leases/worker_table.h"

#include <algorithm>
#include <utility>

namespace calib::scheduler {
namespace {

/// Workers, those that are gone among them. Chosen: some times those of a large cluster; the number
/// of those that are there is that of connections.
constexpr std::size_t kMostRemembered = 4000;

bool TakesWork(const WorkerEntry& entry, Clock::time_point heard_since) {
  return entry.session != 0 && !entry.draining && !entry.leaving && entry.heard >= heard_since;
}

}  // namespace

std::int64_t WorkerTable::Connect(const v1::Hello& hello, std::int64_t session,
                                  Clock::time_point now) {
  WorkerEntry& entry = workers_[hello.name()];
  const std::int64_t before = entry.session;
  entry.draining =
      entry.draining && !entry.leaving;  // a drained worker that is started again works
  entry.leaving = false;
  entry.hello = hello;
  entry.hello.clear_attempts();
  entry.session = session;
  entry.heard = now;
  if (workers_.size() > kMostRemembered) {
    ForgetOldest();
  }
  return before;
}

void WorkerTable::ForgetOldest() {
  auto oldest = workers_.end();
  for (auto it = workers_.begin(); it != workers_.end(); ++it) {
    if (it->second.session == 0 &&
        (oldest == workers_.end() || it->second.heard < oldest->second.heard)) {
      oldest = it;
    }
  }
  if (oldest != workers_.end()) {
    workers_.erase(oldest);
  }
}

bool WorkerTable::IsAnother(const v1::Hello& hello, Clock::time_point heard_since) const {
  const auto found = workers_.find(hello.name());
  if (found == workers_.end()) {
    return false;
  }
  const WorkerEntry& entry = found->second;
  return entry.hello.instance() != hello.instance() && entry.session != 0 && !entry.leaving &&
         entry.heard >= heard_since;
}

void WorkerTable::Disconnect(std::int64_t session) {
  if (WorkerEntry* entry = OfSession(session); entry != nullptr) {
    entry->session = 0;
  }
}

WorkerEntry* WorkerTable::Find(const std::string& name) {
  const auto found = workers_.find(name);
  return found == workers_.end() ? nullptr : &found->second;
}

WorkerEntry* WorkerTable::OfSession(std::int64_t session) {
  for (auto& [name, entry] : workers_) {
    if (entry.session == session) {
      return &entry;
    }
  }
  return nullptr;
}

void WorkerTable::ForgetGone(Clock::time_point heard_since) {
  std::erase_if(workers_, [heard_since](const auto& item) {
    return item.second.session == 0 && item.second.heard < heard_since;
  });
}

std::vector<const WorkerEntry*> WorkerTable::Free(const LeaseTable& leases,
                                                  Clock::time_point heard_since) const {
  std::vector<std::pair<int, const WorkerEntry*>> free;
  for (const auto& [name, entry] : workers_) {
    const int slots = entry.hello.slots() - leases.Busy(name);
    if (TakesWork(entry, heard_since) && slots > 0) {
      free.emplace_back(slots, &entry);
    }
  }
  std::stable_sort(free.begin(), free.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<const WorkerEntry*> workers;
  workers.reserve(free.size());
  for (const auto& [slots, entry] : free) {
    workers.push_back(entry);
  }
  return workers;
}

bool WorkerTable::IsThere(const std::string& checkpoints, Clock::time_point heard_since) const {
  return std::any_of(workers_.begin(), workers_.end(), [&](const auto& item) {
    return TakesWork(item.second, heard_since) && item.second.hello.checkpoints() == checkpoints;
  });
}

int WorkerTable::Slots() const {
  int slots = 0;
  for (const auto& [name, entry] : workers_) {
    slots += entry.session != 0 ? entry.hello.slots() : 0;
  }
  return slots;
}

}  // namespace calib::scheduler
