#pragma once
// Which campaign comes from which.

#include <string>
#include <vector>

#include "calib/v1/campaign.pb.h"

namespace calib::report {

/// A campaign in the tree of who comes from whom.
struct Branch {
  v1::CampaignStatus status;
  int depth = 0;  ///< 0: its parent is not in the list
};

/// Children below their parents, depth first, siblings in the order of the list. campaigns: in the
/// order of their ids, as the server gives them; a parent has a smaller id than its children, what
/// else a text may say of its parent is passed over. Pure.
std::vector<Branch> AsTree(const std::vector<v1::CampaignStatus>& campaigns);

/// Everything that comes from a campaign, itself left out, in the order of AsTree().
std::vector<v1::CampaignStatus> Descendants(const std::vector<v1::CampaignStatus>& campaigns,
                                            const std::string& campaign);

/// Those of `campaigns` that come from `campaign` directly, in their order.
std::vector<v1::CampaignStatus> ChildrenOf(const std::vector<v1::CampaignStatus>& campaigns,
                                           const std::string& campaign);

/// The whole family of a campaign: the first that it comes from and all that come from that, depth
/// from there; empty: there is no such campaign.
std::vector<Branch> FamilyOf(const std::vector<v1::CampaignStatus>& campaigns,
                             const std::string& campaign);

/// "2 screen, 1 extension": how many of each purpose, in the order of their first.
std::string CountedByPurpose(const std::vector<v1::CampaignStatus>& campaigns);

}  // namespace calib::report
