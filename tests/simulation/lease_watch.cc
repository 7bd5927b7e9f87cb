#include "tests/simulation/lease_watch.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace calib::simulation {

void LeaseWatch::Heard(const std::string& worker, int stream, bool is_welcomed, Time now) {
  Voice& voice = voices_[worker];
  if (is_welcomed) voice.stream = stream;
  if (stream == voice.stream) voice.heard = now;
}

std::string LeaseWatch::Look(scheduler::Scheduler& scheduler, Time now, bool of_tick) {
  if (scheduler.workers_changed() == seen_) return "";
  seen_ = scheduler.workers_changed();
  std::string wrong;
  const auto tell = [&wrong](const std::string& what) {
    if (wrong.empty()) wrong = what;
  };
  std::set<std::string> all;
  for (const v1::WorkerInfo& worker : scheduler.Workers()) {
    std::multiset<std::string> runs(worker.running().begin(), worker.running().end());
    for (const std::string& run : runs) {
      if (!all.insert(run).second) tell(absl::StrCat("two leases of the run ", run));
    }
    Leased& before = leased_[worker.name()];
    if (before.drains && worker.draining() &&
        !std::includes(before.runs.begin(), before.runs.end(), runs.begin(), runs.end())) {
      tell(absl::StrCat("worker ", worker.name(), " drains and is leased more"));
    }
    const auto voice = voices_.find(worker.name());
    if (of_tick && voice != voices_.end() && now - voice->second.heard <= lease_ &&
        runs.size() < before.runs.size()) {
      tell(absl::StrCat("a lease of ", worker.name(), " has ended, which was heard"));
    }
    before = {.drains = worker.draining(), .runs = std::move(runs)};
    if (worker.busy() > worker.slots()) {
      tell(absl::StrCat("worker ", worker.name(), " has ", worker.busy(), " slots busy of ",
                        worker.slots()));
    }
  }
  return wrong;
}

}  // namespace calib::simulation
