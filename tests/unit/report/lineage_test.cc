#include "server/report/views/lineage.h"

#include <gtest/gtest.h>

namespace calib::report {
namespace {

v1::CampaignStatus Make(const std::string& id, const std::string& parent,
                        const std::string& purpose) {
  v1::CampaignStatus status;
  status.set_campaign(id);
  status.set_parent(parent);
  status.set_purpose(purpose);
  return status;
}

// c1 with two trials and an extension that was tried further; c3 says that it is its own parent, c6
// that it comes from one that is gone, c7 from a later one.
const std::vector<v1::CampaignStatus>& Campaigns() {
  static const std::vector<v1::CampaignStatus> campaigns = {
      Make("c1", "", ""),           Make("c2", "c1", "screen"),
      Make("c3", "c3", "mine"),     Make("c4", "c1", "extension"),
      Make("c5", "c4", "screen"),   Make("c6", "c0", "screen"),
      Make("c7", "c8", "mine"),     Make("c8", "c1", "screen"),
      Make("c10", "c5", "warm_fit")};
  return campaigns;
}

std::string Ids(const std::vector<v1::CampaignStatus>& campaigns) {
  std::string text;
  for (const auto& c : campaigns) text += c.campaign() + " ";
  return text;
}

TEST(Lineage, IsATreeWithEveryCampaignOnce) {
  std::string text;
  for (const Branch& branch : AsTree(Campaigns())) {
    text +=
        std::string(static_cast<std::size_t>(branch.depth), '.') + branch.status.campaign() + " ";
  }
  EXPECT_EQ(text, "c1 .c2 .c4 ..c5 ...c10 .c8 c3 c6 c7 ");
}

TEST(Lineage, KnowsChildrenAndAllThatComesFromACampaign) {
  EXPECT_EQ(Ids(Descendants(Campaigns(), "c1")), "c2 c4 c5 c10 c8 ");
  EXPECT_EQ(Ids(ChildrenOf(Campaigns(), "c1")), "c2 c4 c8 ");
  EXPECT_EQ(Ids(Descendants(Campaigns(), "c3")), "");
  EXPECT_EQ(Ids(Descendants(Campaigns(), "c99")), "");
  EXPECT_EQ(CountedByPurpose(Descendants(Campaigns(), "c1")), "3 screen, 1 extension, 1 warm_fit");
}

TEST(Lineage, AFamilyIsTheSameForEachOfItsMembers) {
  for (const char* member : {"c1", "c4", "c10"}) {
    std::string ids;
    for (const Branch& branch : FamilyOf(Campaigns(), member)) {
      ids += branch.status.campaign() + ":" + std::to_string(branch.depth) + " ";
    }
    EXPECT_EQ(ids, "c1:0 c2:1 c4:1 c5:2 c10:3 c8:1 ") << member;
  }
  EXPECT_EQ(FamilyOf(Campaigns(), "c3").size(), 1U);
  EXPECT_TRUE(FamilyOf(Campaigns(), "c99").empty());
}

}  // namespace
}  // namespace calib::report
