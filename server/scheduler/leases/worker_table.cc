#include "server/scheduler/leases/worker_table.h"

#include <algorithm>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "proto/calib/v1/protocol.h"

namespace calib::scheduler {
namespace {

/// Workers, those that are gone among them. Chosen: some times those of a large cluster; the number
/// of those that are there is that of connections.
constexpr std::size_t kMostRemembered = 4000;

bool TakesWork(const WorkerEntry& entry) {
  return entry.session != 0 && !entry.draining && !entry.leaving && !entry.silent;
}

// Fewer than none where it came back with more leases than it has slots.
int FreeSlots(const WorkerEntry& entry) { return entry.hello.slots() - entry.busy; }

}  // namespace

WorkerTable::Kind WorkerTable::KindOf(const v1::Hello& hello) {
  return {.programs = {hello.programs().begin(), hello.programs().end()},
          .slots = hello.slots(),
          .threads = hello.threads() > 0 ? hello.threads()
                                         : hello.slots() * std::max(1, hello.threads_per_slot()),
          .memory = hello.memory(),
          .mechanics = Mechanics(hello.engine_version(), hello.catalog_digest()),
          .limits_runs = std::find(hello.features().begin(), hello.features().end(), kLimitsRuns) !=
                         hello.features().end()};
}

std::string WorkerTable::Mechanics(const std::string& version, const std::string& catalog_digest) {
  return absl::StrCat(version, " ", catalog_digest);
}

bool WorkerTable::Freer::operator()(const WorkerEntry* a, const WorkerEntry* b) const {
  return std::make_tuple(-FreeSlots(*a), std::cref(a->hello.name())) <
         std::make_tuple(-FreeSlots(*b), std::cref(b->hello.name()));
}

void WorkerTable::Index(const WorkerEntry& entry) {
  if (entry.session != 0) {
    slots_ += entry.hello.slots();
  }
  if (!TakesWork(entry)) {
    return;
  }
  Folder& folder = there_[entry.hello.checkpoints()];
  ++folder.workers;
  if (FreeSlots(entry) > 0) {
    folder.free.insert(&entry);
    free_slots_ += FreeSlots(entry);
  }
  kinds_[KindOf(entry.hello)].insert(&entry);
}

void WorkerTable::Unindex(const WorkerEntry& entry) {
  if (entry.session != 0) {
    slots_ -= entry.hello.slots();
  }
  if (!TakesWork(entry)) {
    return;
  }
  const auto folder = there_.find(entry.hello.checkpoints());
  if (FreeSlots(entry) > 0) {
    folder->second.free.erase(&entry);
    free_slots_ -= FreeSlots(entry);
  }
  const auto ranking = kinds_.find(KindOf(entry.hello));
  ranking->second.erase(&entry);
  if (ranking->second.empty()) {
    kinds_.erase(ranking);
  }
  if (--folder->second.workers == 0) {
    there_.erase(folder);
  }
}

std::int64_t WorkerTable::Connect(const v1::Hello& hello, std::int64_t session, int busy,
                                  Clock::time_point now) {
  WorkerEntry& entry = workers_[hello.name()];
  const std::int64_t before = entry.session;
  if (before != 0) {
    by_session_.erase(before);
  }
  Change(entry, [&](WorkerEntry& worker) {
    worker.draining =
        worker.draining && !worker.leaving;  // a drained worker that is started again works
    worker.leaving = false;
    worker.silent = false;
    worker.hello = hello;
    worker.hello.clear_attempts();
    worker.session = session;
    worker.busy = busy;
    worker.heard = now;
  });
  by_session_[session] = &entry;
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
  const WorkerEntry* entry = Find(hello.name());
  return entry != nullptr && entry->hello.instance() != hello.instance() && entry->session != 0 &&
         !entry->leaving && entry->heard >= heard_since;
}

void WorkerTable::Disconnect(std::int64_t session) {
  const auto found = by_session_.find(session);
  if (found == by_session_.end()) {
    return;
  }
  Change(*found->second, [](WorkerEntry& worker) { worker.session = 0; });
  by_session_.erase(found);
}

void WorkerTable::SetBusy(const std::string& name, int leases) {
  if (const auto found = workers_.find(name); found != workers_.end()) {
    Change(found->second, [leases](WorkerEntry& worker) { worker.busy = leases; });
  }
}

void WorkerTable::Drain(const std::string& name, std::optional<Clock::time_point> by) {
  if (const auto found = workers_.find(name); found != workers_.end()) {
    Change(found->second, [by](WorkerEntry& worker) {
      worker.draining = true;
      worker.drained_by = by;
    });
  }
}

void WorkerTable::Leave(std::int64_t session) {
  if (const auto found = by_session_.find(session); found != by_session_.end()) {
    Change(*found->second, [](WorkerEntry& worker) { worker.leaving = true; });
  }
}

const WorkerEntry* WorkerTable::Heard(std::int64_t session, Clock::time_point now,
                                      bool* was_silent) {
  const auto found = by_session_.find(session);
  if (found == by_session_.end()) {
    return nullptr;
  }
  WorkerEntry& entry = *found->second;
  entry.heard = now;
  if (entry.silent) {
    *was_silent = true;
    Change(entry, [](WorkerEntry& worker) { worker.silent = false; });
  }
  return &entry;
}

void WorkerTable::Review(Clock::time_point heard_since, Clock::time_point remembered_since) {
  std::erase_if(workers_, [remembered_since](const auto& item) {  // these are in no index
    return item.second.session == 0 && item.second.heard < remembered_since;
  });
  for (auto& [name, entry] : workers_) {
    if (!entry.silent && entry.heard < heard_since) {
      Change(entry, [](WorkerEntry& worker) { worker.silent = true; });
    }
  }
}

const WorkerEntry* WorkerTable::Find(const std::string& name) const {
  const auto found = workers_.find(name);
  return found == workers_.end() ? nullptr : &found->second;
}

const WorkerEntry* WorkerTable::OfSession(std::int64_t session) const {
  const auto found = by_session_.find(session);
  return found == by_session_.end() ? nullptr : found->second;
}

WorkerTable::Choice WorkerTable::Freest(const Needs& needs, const Others& without) const {
  Choice best;
  for (const auto& [kind, ranking] : kinds_) {
    const int slots = needs(kind);
    if (slots == 0 || slots > kind.slots) {
      continue;
    }
    const auto first = std::find_if(ranking.begin(), ranking.end(), [&](const WorkerEntry* worker) {
      return without.count(worker->hello.name()) == 0;
    });
    if (first == ranking.end()) {
      continue;
    }
    const Choice choice{
        .worker = *first, .slots = slots, .missing = std::max(0, slots - FreeSlots(**first))};
    if (best.worker == nullptr || choice.missing < best.missing ||
        (choice.missing == best.missing && Freer()(choice.worker, best.worker))) {
      best = choice;
    }
  }
  return best;
}

WorkerTable::Choice WorkerTable::FreestAt(const std::string& checkpoints, const Needs& needs,
                                          const Others& without) const {
  const auto folder = there_.find(checkpoints);
  if (folder == there_.end()) {
    return {};
  }
  for (const WorkerEntry* worker : folder->second.free) {
    const int slots = needs(KindOf(worker->hello));
    if (slots > 0 && slots <= FreeSlots(*worker) && without.count(worker->hello.name()) == 0) {
      return {.worker = worker, .slots = slots};
    }
  }
  return {};
}

}  // namespace calib::scheduler
