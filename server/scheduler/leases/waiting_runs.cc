#include "server/scheduler/leases/waiting_runs.h"

namespace calib::scheduler {

using store::EvaluationKey;

void WaitingRuns::Put(const EvaluationKey& key, const std::string& held_in) {
  const auto [entry, added] = held_in_.try_emplace(key, held_in);
  if (!added) {
    if (entry->second == held_in) {
      return;
    }
    Take(key);
    held_in_.emplace(key, held_in);
  }
  groups_[{key.campaign, held_in}].insert(key);
}

void WaitingRuns::Take(const EvaluationKey& key) {
  const auto entry = held_in_.find(key);
  if (entry == held_in_.end()) {
    return;
  }
  const auto group = groups_.find({key.campaign, entry->second});
  group->second.erase(key);
  if (group->second.empty()) {
    groups_.erase(group);
  }
  held_in_.erase(entry);
}

void WaitingRuns::TakeAll(std::int64_t campaign) {
  held_in_.erase(held_in_.lower_bound({.campaign = campaign, .sample = 0, .experiment = 0}),
                 held_in_.lower_bound({.campaign = campaign + 1, .sample = 0, .experiment = 0}));
  groups_.erase(groups_.lower_bound({campaign, ""}), groups_.lower_bound({campaign + 1, ""}));
}

std::vector<WaitingRuns::Group> WaitingRuns::Groups() const {
  std::vector<Group> groups;
  groups.reserve(groups_.size());
  for (const auto& [group, keys] : groups_) {
    groups.push_back(group);
  }
  return groups;
}

std::optional<EvaluationKey> WaitingRuns::First(const Group& group) const {
  const auto found = groups_.find(group);
  return found == groups_.end() ? std::nullopt : std::optional(*found->second.begin());
}

}  // namespace calib::scheduler
