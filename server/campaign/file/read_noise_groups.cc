#include "server/campaign/file/read_noise_groups.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

using Member = std::pair<int, int>;

// (experiment, observable) of "stress_ratio" or "tx02.stress_ratio", of experiments that calibrate.
std::vector<Member> MembersOf(const Campaign& campaign, const std::string& name) {
  std::vector<Member> members;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    const Experiment& experiment = campaign.experiments[e];
    if (experiment.role != Role::kCalibrate) continue;
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const std::string& observable = experiment.observables[j].name;
      if (name == observable || name == absl::StrCat(experiment.name, ".", observable)) {
        members.emplace_back(static_cast<int>(e), static_cast<int>(j));
      }
    }
  }
  return members;
}

std::vector<std::string> AllNames(const Campaign& campaign) {
  std::set<std::string> plain;
  for (const Experiment& experiment : campaign.experiments) {
    if (experiment.role != Role::kCalibrate) continue;
    for (const MeasuredObservable& observable : experiment.observables)
      plain.insert(observable.name);
  }
  return {plain.begin(), plain.end()};
}

void ReadGroup(const YamlNode& node, const std::string& path, std::set<Member>& taken,
               Campaign& campaign, ProblemList& problems) {
  MapReader map(node, path, problems);
  if (node.kind != YamlNode::Kind::kMap) return;
  SharedNoise shared;
  if (map.Require("observables", "the names whose errors share one factor") != nullptr) {
    for (const std::string& name :
         map.TextList("observables").value_or(std::vector<std::string>{})) {
      const std::vector<Member> members = MembersOf(campaign, name);
      if (members.empty()) {
        map.Problem("observables",
                    absl::StrCat("'", name, "' is not fitted in any experiment; fitted are ",
                                 Listed(AllNames(campaign)), ", alone or as EXPERIMENT.NAME"));
      }
      for (const Member& member : members) {
        if (taken.insert(member).second) {
          shared.members.push_back(member);
        } else {
          map.Problem(
              "observables",
              absl::StrCat("'", name, "' stands in two groups; its errors have one factor"));
        }
      }
    }
  }
  shared.prior.shape = map.Quantity("shape", "1", kPositive).value_or(shared.prior.shape);
  shared.prior.rate = map.Quantity("rate", "1", kPositive).value_or(shared.prior.rate);
  map.Finish();
  if (!shared.members.empty()) campaign.shared_noise.push_back(std::move(shared));
}

}  // namespace

void ReadNoiseGroups(MapReader& campaign_map, Campaign& campaign) {
  const YamlNode* node = campaign_map.Find("noise");
  if (node == nullptr || node->kind != YamlNode::Kind::kMap) return;
  const auto entry = std::find_if(node->entries.begin(), node->entries.end(),
                                  [](const YamlEntry& e) { return e.key == "inferred"; });
  if (entry == node->entries.end()) return;
  const YamlNode& list = entry->value;
  if (list.kind != YamlNode::Kind::kSequence || list.items.empty()) {
    campaign_map.problems().Add(entry->line, "noise.inferred",
                                "has to be a list of groups, each with its observables; without "
                                "groups write noise: inferred");
    return;
  }
  std::set<Member> taken;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    ReadGroup(list.items[i], absl::StrCat("noise.inferred[", i + 1, "]"), taken, campaign,
              campaign_map.problems());
  }
}

}  // namespace calib::campaign
