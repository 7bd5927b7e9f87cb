#include "server/scheduler/worker_table.h"

namespace calib::scheduler {

std::int64_t WorkerTable::Connect(const v1::Hello& hello, std::int64_t session,
                                  Clock::time_point now) {
  WorkerEntry& entry = workers_[hello.name()];
  const std::int64_t before = entry.session;
  entry.draining =
      entry.draining && !entry.leaving;  // a drained worker that is started again works
  entry.leaving = false;
  entry.hello = hello;
  entry.session = session;
  entry.heard = now;
  return before;
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

const WorkerEntry* WorkerTable::MostFree(const LeaseTable& leases,
                                         Clock::time_point heard_since) const {
  const WorkerEntry* best = nullptr;
  int most = 0;
  for (const auto& [name, entry] : workers_) {
    const int free = entry.hello.slots() - leases.Busy(name);
    if (entry.session != 0 && !entry.draining && !entry.leaving && entry.heard >= heard_since &&
        free > most) {
      best = &entry;
      most = free;
    }
  }
  return best;
}

int WorkerTable::Slots() const {
  int slots = 0;
  for (const auto& [name, entry] : workers_) {
    slots += entry.session != 0 ? entry.hello.slots() : 0;
  }
  return slots;
}

}  // namespace calib::scheduler
