// The same run asked for by several campaigns is made once. What had ended when a campaign was
// planned is reused by its plan (requests.h); here is what ends afterwards.
#include <utility>

#include "server/planning/decisions.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

bool Scheduler::IsShared(const EvaluationKey& key) {
  CampaignRun* run = FindRun(key.campaign);
  return run != nullptr && planning::RunsToItsEnds(run->definition()) &&
         !run->Find(key)->digest.empty();
}

std::string Scheduler::SharedDigest(const EvaluationKey& key) {
  return IsShared(key) ? FindRun(key.campaign)->Find(key)->digest : "";
}

bool Scheduler::WaitsForAnother(const EvaluationKey& key) {
  if (runs_.size() < 2 || !IsShared(key)) return false;
  const std::string& digest = FindRun(key.campaign)->Find(key)->digest;
  if (under_way_.count(digest) == 0) return false;
  waiting_.Take(key);
  parked_[digest].insert(key);
  return true;
}

void Scheduler::UnderWay(const std::string& digest) {
  if (!digest.empty()) ++under_way_[digest];
}

void Scheduler::NoLongerUnderWay(const std::string& digest) {
  const auto found = under_way_.find(digest);
  if (found == under_way_.end() || --found->second > 0) return;
  under_way_.erase(found);
  const auto parked = parked_.extract(digest);
  if (parked.empty()) return;
  for (const EvaluationKey& key : parked.mapped()) {
    if (CampaignRun* run = FindRun(key.campaign); run != nullptr) Offer(*run, key.sample);
  }
}

std::vector<EvaluationKey> Scheduler::SharedWaiting(CampaignRun& run, const std::string& digest) {
  std::vector<EvaluationKey> keys;
  for (const EvaluationKey& key :
       digest.empty() ? run.With(EvaluationStatus::kWaiting) : run.WaitingFor(digest)) {
    if (IsShared(key)) keys.push_back(key);
  }
  return keys;
}

void Scheduler::TakeFromOthers(CampaignRun& run, const std::string& digest) {
  const std::vector<EvaluationKey> waiting = SharedWaiting(run, digest);
  if (waiting.empty()) return;
  auto reader = ports_.Read();
  if (!reader.ok()) return;  // they are run, then
  std::vector<EvaluationKey> taken;
  std::vector<std::pair<EvaluationKey, EvaluationKey>> from_to;
  for (const EvaluationKey& key : waiting) {
    const auto equal = reader->FindEqual(run.Find(key)->digest);
    if (!equal.ok() || !equal->has_value()) continue;
    const int failures = run.Find(key)->failures;
    SetStatus(run, key, EvaluationStatus::kRunning, failures);  // without a lease
    taken.push_back(key);
    from_to.emplace_back(**equal, key);
  }
  if (taken.empty()) return;
  Write(
      run.id(),
      [from_to = std::move(from_to)](Transaction& transaction) {
        for (const auto& [from, to] : from_to) {
          transaction.ReuseEvaluation(from, to);
        }
      },
      [this, campaign = run.id(), taken = std::move(taken)](const absl::Status& /*written*/) {
        Taken(campaign, taken);  // as much of it as the disk has
      });
}

void Scheduler::Taken(std::int64_t campaign, const std::vector<EvaluationKey>& keys) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr) {
    return;
  }
  auto reader = ports_.Read();
  if (!reader.ok() || !run->Refresh(*reader, keys).ok()) {
    // After whatever else is to be tried again for this campaign.
    again_[campaign] = [this, campaign, keys, before = again_[campaign]] {
      if (before) before();
      Taken(campaign, keys);
    };
    return;
  }
  Changed(campaign);
  Enqueue(*run);
  Advance(campaign);
  Dispatch();
}

}  // namespace calib::scheduler
