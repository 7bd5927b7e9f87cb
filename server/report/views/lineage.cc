#include "server/report/views/lineage.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::report {
namespace {

constexpr std::size_t kNoParent = static_cast<std::size_t>(-1);

using Children = std::map<std::size_t, std::vector<std::size_t>>;  // by parent; kNoParent: roots

void AddBranch(const std::vector<v1::CampaignStatus>& campaigns, const Children& children,
               std::size_t parent, int depth, std::vector<Branch>& tree) {
  const auto below = children.find(parent);
  if (below == children.end()) return;
  for (const std::size_t child : below->second) {
    tree.push_back({.status = campaigns[child], .depth = depth});
    AddBranch(campaigns, children, child, depth + 1, tree);
  }
}

}  // namespace

std::vector<Branch> AsTree(const std::vector<v1::CampaignStatus>& campaigns) {
  std::map<std::string, std::size_t> earlier;
  Children children;
  for (std::size_t k = 0; k < campaigns.size(); ++k) {
    const auto parent = earlier.find(campaigns[k].parent());
    children[parent == earlier.end() ? kNoParent : parent->second].push_back(k);
    earlier[campaigns[k].campaign()] = k;
  }
  std::vector<Branch> tree;
  AddBranch(campaigns, children, kNoParent, 0, tree);
  return tree;
}

std::vector<v1::CampaignStatus> Descendants(const std::vector<v1::CampaignStatus>& campaigns,
                                            const std::string& campaign) {
  std::vector<v1::CampaignStatus> below;
  int depth = -1;  // of the campaign, once it was met
  for (Branch& branch : AsTree(campaigns)) {
    if (branch.status.campaign() == campaign) {
      depth = branch.depth;
    } else if (depth >= 0) {
      if (branch.depth <= depth) break;
      below.push_back(std::move(branch.status));
    }
  }
  return below;
}

std::vector<v1::CampaignStatus> ChildrenOf(const std::vector<v1::CampaignStatus>& campaigns,
                                           const std::string& campaign) {
  std::vector<v1::CampaignStatus> children;
  std::copy_if(campaigns.begin(), campaigns.end(), std::back_inserter(children),
               [&campaign](const auto& c) { return c.parent() == campaign; });
  return children;
}

std::vector<Branch> FamilyOf(const std::vector<v1::CampaignStatus>& campaigns,
                             const std::string& campaign) {
  std::vector<Branch> family;
  bool is_own = false;
  for (Branch& branch : AsTree(campaigns)) {
    if (branch.depth == 0) {
      if (is_own) break;
      family.clear();
    }
    is_own = is_own || branch.status.campaign() == campaign;
    family.push_back(std::move(branch));
  }
  return is_own ? family : std::vector<Branch>();
}

std::string CountedByPurpose(const std::vector<v1::CampaignStatus>& campaigns) {
  std::vector<std::pair<std::string, int>> counts;
  for (const v1::CampaignStatus& c : campaigns) {
    const auto same = std::find_if(counts.begin(), counts.end(),
                                   [&c](const auto& count) { return count.first == c.purpose(); });
    if (same == counts.end()) {
      counts.emplace_back(c.purpose(), 1);
    } else {
      ++same->second;
    }
  }
  std::string text;
  for (const auto& [purpose, count] : counts) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", count, " ",
                    purpose.empty() ? "derived" : purpose);
  }
  return text;
}

}  // namespace calib::report
