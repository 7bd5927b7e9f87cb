#pragma once
// The evaluations that could be leased now.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/records.h"

namespace calib::scheduler {

/// By campaign and, where they rest, by the checkpoint folder that holds what they came to: each
/// call takes O(log n) and what it returns. Not thread-safe.
class WaitingRuns {
 public:
  /// held_in: see store::EvaluationRecord; it may change.
  void Put(const store::EvaluationKey& key, const std::string& held_in);
  /// Takes it out, if it is there; all of a campaign.
  void Take(const store::EvaluationKey& key);
  void TakeAll(std::int64_t campaign);

  bool empty() const { return groups_.empty(); }
  std::size_t size() const { return held_in_.size(); }

  /// Those of one campaign and folder, which the same workers may be leased.
  using Group = std::pair<std::int64_t, std::string>;
  std::vector<Group> Groups() const;
  /// The first of a group in order of keys; empty: none is left.
  std::optional<store::EvaluationKey> First(const Group& group) const;

 private:
  std::map<store::EvaluationKey, std::string> held_in_;
  std::map<Group, std::set<store::EvaluationKey>> groups_;  // none of them empty
};

}  // namespace calib::scheduler
