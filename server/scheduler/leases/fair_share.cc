#include "server/scheduler/leases/fair_share.h"

#include <algorithm>
#include <cassert>

namespace calib::scheduler {
namespace {

template <typename Key>
Shares::Share ShareOf(const std::map<Key, Shares::Share>& shares, const Key& key) {
  const auto found = shares.find(key);
  return found == shares.end() ? Shares::Share{} : found->second;
}

}  // namespace

void Shares::Take(const Holding& holding) {
  for (Share* share : {&owners_[holding.owner], &campaigns_[holding.campaign]}) {
    share->held += holding.slots;
    share->served = std::max(share->served, holding.attempt);
  }
}

void Shares::Return(const Holding& holding) {
  for (Share* share : {&owners_[holding.owner], &campaigns_[holding.campaign]}) {
    share->held -= holding.slots;
    assert(share->held >= 0);
  }
}

void Shares::SetQuota(const std::string& owner, std::optional<int> slots) {
  if (slots.has_value()) {
    quotas_[owner] = *slots;
  } else {
    quotas_.erase(owner);
  }
}

std::optional<int> Shares::Quota(const std::string& owner) const {
  const auto found = quotas_.find(owner);
  return found == quotas_.end() ? std::nullopt : std::optional(found->second);
}

int Shares::Left(const std::string& owner) const {
  const auto quota = Quota(owner);
  return quota.has_value() ? std::max(0, *quota - OfOwner(owner).held)
                           : std::numeric_limits<int>::max();
}

std::set<std::string> Shares::Owners() const {
  std::set<std::string> owners;
  for (const auto& [owner, share] : owners_) {
    if (share.held > 0) owners.insert(owner);
  }
  for (const auto& [owner, slots] : quotas_) owners.insert(owner);
  return owners;
}

Shares::Share Shares::OfOwner(const std::string& owner) const { return ShareOf(owners_, owner); }

Shares::Share Shares::OfCampaign(std::int64_t campaign) const {
  return ShareOf(campaigns_, campaign);
}

FairLine::CampaignRank FairLine::RankOf(std::int64_t campaign, int behind) const {
  const Shares::Share share = shares_.OfCampaign(campaign);
  return {.behind = behind, .held = share.held, .served = share.served, .campaign = campaign};
}

FairLine::OwnerRank FairLine::RankOf(const std::string& owner) const {
  const Shares::Share share = shares_.OfOwner(owner);
  return {.held = share.held, .served = share.served, .owner = owner};
}

void FairLine::Enter(const Place& place) {
  const auto [at, is_new] = owners_.try_emplace(place.owner);
  Owner& owner = at->second;
  if (is_new) {
    owner.rank = RankOf(place.owner);
    order_.insert(owner.rank);
  }
  const std::int64_t id = place.group.first;
  const auto [campaign, comes] = owner.campaigns.try_emplace(id);
  if (comes) {
    campaign->second.rank = RankOf(id, -place.priority);
    owner.order.insert(campaign->second.rank);
  }
  campaign->second.groups.emplace(place.first, place.group);
}

FairLine::Place FairLine::Take() {
  const auto at = owners_.find(order_.begin()->owner);
  Owner& owner = at->second;
  const auto campaign = owner.campaigns.find(owner.order.begin()->campaign);
  Groups& groups = campaign->second.groups;
  Place place{.first = groups.begin()->first,
              .group = groups.begin()->second,
              .owner = at->first,
              .priority = -campaign->second.rank.behind};
  groups.erase(groups.begin());
  if (groups.empty()) {
    owner.order.erase(campaign->second.rank);
    owner.campaigns.erase(campaign);
  }
  if (owner.campaigns.empty()) {
    order_.erase(owner.rank);
    owners_.erase(at);
  }
  return place;
}

void FairLine::Served(const std::string& owner_name, std::int64_t id) {
  const auto at = owners_.find(owner_name);
  if (at == owners_.end()) {
    return;
  }
  Owner& owner = at->second;
  order_.erase(owner.rank);
  owner.rank = RankOf(owner_name);
  order_.insert(owner.rank);
  if (const auto campaign = owner.campaigns.find(id); campaign != owner.campaigns.end()) {
    owner.order.erase(campaign->second.rank);
    campaign->second.rank = RankOf(id, campaign->second.rank.behind);
    owner.order.insert(campaign->second.rank);
  }
}

}  // namespace calib::scheduler
