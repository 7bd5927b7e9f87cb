#pragma once
// Whose run takes the next free slots: first the owner who holds fewest; of an owner's campaigns
// first those of highest priority, among these the one that holds fewest. Who is level goes by who
// was served longest ago, then by name or id. So priority orders the campaigns of one owner and
// takes nothing from another. An owner with a quota holds no more than that.

#include <compare>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "server/scheduler/leases/waiting_runs.h"

namespace calib::scheduler {

/// What each owner and each campaign holds of the slots of all workers, in slots >= 0. A call takes
/// O(log n). Not thread-safe.
class Shares {
 public:
  struct Share {
    int held = 0;
    std::int64_t served = 0;  ///< attempt of its last grant; 0: none
  };
  struct Holding {
    std::string owner{};  ///< of the campaign; empty: nobody knows, which is one owner more
    std::int64_t campaign = 0;
    std::int64_t attempt = 0;
    int slots = 1;
  };
  void Take(const Holding& holding);
  /// Of what was taken.
  void Return(const Holding& holding);

  /// Slots that an owner holds at most from now on, >= 0; what is above runs to its end. Empty: no
  /// bound.
  void SetQuota(const std::string& owner, std::optional<int> slots);
  std::optional<int> Quota(const std::string& owner) const;
  /// Slots that an owner may take yet.
  int Left(const std::string& owner) const;

  Share OfOwner(const std::string& owner) const;
  Share OfCampaign(std::int64_t campaign) const;
  /// Owners that hold something or have a quota.
  std::set<std::string> Owners() const;

 private:
  std::map<std::string, Share> owners_;
  std::map<std::int64_t, Share> campaigns_;
  std::map<std::string, int> quotas_;
};

/// What waits, in the order in which it is to be leased, for one turn: nothing but what this line
/// is told changes meanwhile. A call takes O(log n). Not thread-safe.
class FairLine {
 public:
  /// Runs of one campaign and folder, the first of them.
  struct Place {
    store::EvaluationKey first{};
    WaitingRuns::Group group{};
    std::string owner{};
    int priority = 0;  ///< of the campaign
  };

  explicit FairLine(const Shares& shares) : shares_(shares) {}
  FairLine(const FairLine&) = delete;
  FairLine& operator=(const FairLine&) = delete;

  void Enter(const Place& place);
  bool empty() const { return order_.empty(); }
  /// Takes out what comes first; the line is not empty.
  Place Take();
  /// The shares of this owner and campaign have changed.
  void Served(const std::string& owner, std::int64_t campaign);

 private:
  using Groups = std::set<std::pair<store::EvaluationKey, WaitingRuns::Group>>;
  struct CampaignRank {
    int behind = 0;  ///< minus the priority
    int held = 0;
    std::int64_t served = 0;
    std::int64_t campaign = 0;
    // NOLINTNEXTLINE(modernize-use-nullptr): takes the 0 behind it for a pointer
    friend auto operator<=>(const CampaignRank&, const CampaignRank&) = default;
  };
  struct OwnerRank {
    int held = 0;
    std::int64_t served = 0;
    std::string owner{};
    // NOLINTNEXTLINE(modernize-use-nullptr): takes the 0 behind it for a pointer
    friend auto operator<=>(const OwnerRank&, const OwnerRank&) = default;
  };
  struct InLine {
    CampaignRank rank{};
    Groups groups{};  ///< not empty
  };
  struct Owner {
    OwnerRank rank{};
    std::map<std::int64_t, InLine> campaigns{};  ///< not empty
    std::set<CampaignRank> order{};              ///< of these
  };

  CampaignRank RankOf(std::int64_t campaign, int behind) const;
  OwnerRank RankOf(const std::string& owner) const;

  const Shares& shares_;
  std::map<std::string, Owner> owners_;
  std::set<OwnerRank> order_;
};

}  // namespace calib::scheduler
