#include "tests/simulation/lease_watch.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::simulation {

void LeaseWatch::Heard(const std::string& worker, int stream, bool is_welcomed, Time now) {
  Voice& voice = voices_[worker];
  if (is_welcomed) voice.stream = stream;
  if (stream != voice.stream) return;
  voice.heard = now;
  voice.heard_awake = awake_;
}

std::string LeaseWatch::Outlived(Time now) {
  const Time::duration since = now - std::exchange(ticked_, now);
  // A server that has slept so long gives everybody a lease time to be heard.
  if (since > lease_ / 2) {
    for (auto& [name, voice] : voices_) voice.heard_awake = awake_;
    return "";
  }
  awake_ += since;
  for (const auto& [name, leased] : leased_) {
    // A lease that ends with the first tick after its time has then lasted a lease and a tick.
    if (!leased.runs.empty() && awake_ - voices_[name].heard_awake > 2 * lease_)
      return absl::StrCat("a lease of ", name, " outlives its silence");
  }
  return "";
}

std::string LeaseWatch::Look(scheduler::Scheduler& scheduler, Time now, bool of_tick) {
  std::string wrong = of_tick ? Outlived(now) : "";
  if (scheduler.workers_changed() == seen_) return wrong;
  seen_ = scheduler.workers_changed();
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
    Voice& voice = voices_[worker.name()];
    if (runs.size() > before.runs.size()) voice.heard_awake = awake_;
    if (of_tick && voice.stream > 0 && now - voice.heard <= lease_ &&
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
