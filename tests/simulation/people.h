#pragma once
// Who submits campaigns, and pauses, resumes, cancels and deletes them: what they ask for is asked
// again until it is answered.

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/simulation/dice.h"
#include "tests/simulation/ledger.h"
#include "tests/simulation/server_process.h"
#include "tests/simulation/wire.h"

namespace calib::simulation {

/// Not thread-safe.
class People {
 public:
  /// Who is told what they do, and what must not be.
  struct Told {
    std::function<void(const std::string&)> event, violate;
  };
  People(const Clocks& clocks, Dice& dice, Ledger& ledger, Told told)
      : clocks_(clocks), dice_(dice), ledger_(ledger), told_(std::move(told)) {}

  /// campaign: which of Campaigns().
  void Submit(int campaign, const std::string& owner, Time at);
  /// Somebody asks for something.
  void WishAnything();
  /// Whoever paused campaigns, or set quotas, thinks better of it.
  void SetRight();

  std::size_t wishes() const { return asked_.size(); }
  bool IsDue(std::size_t i) const;
  /// When the next one is due; Time::max(): none is.
  Time next() const;
  void Ask(std::size_t i, ServerProcess& server);
  /// What it was asked is asked again, of the next.
  void ServerIsGone();
  /// What has no answer yet, by verb.
  std::vector<std::string> Waiting() const;

  int first_campaign() const { return asked_.front().campaign; }
  /// Of each campaign that was submitted, which it is.
  const std::map<std::int64_t, int>& submitted() const { return submitted_; }
  bool HasResumed(std::int64_t campaign) const { return resumed_.count(campaign) > 0; }

 private:
  /// What somebody asks for, until it is answered.
  struct Asked {
    ServerProcess::Wish wish;
    int campaign = -1;  ///< of submit: which
    Time at{};
    bool under_way = false;
    bool answered = false;
  };

  Asked& Wish(const std::string& verb, std::int64_t campaign, Time at);
  void Answer(std::size_t i, const absl::StatusOr<std::string>& answer);
  void AddRuns(std::int64_t id, int campaign, int batch);

  const Clocks& clocks_;
  Dice& dice_;
  Ledger& ledger_;
  const Told told_;
  std::deque<Asked> asked_;
  int last_request_ = 0;
  std::map<std::int64_t, int> submitted_;
  std::set<std::int64_t> resumed_;
  bool has_quota_ = false;
};

}  // namespace calib::simulation
